"""Topics of a recording, their schemas, and their contents.

| topic | schema | contents, frame |
|---|---|---|
| /inputs | MessagePack | all inputs of each tick, lossless; needed for replay |
| /ranges | companion.Ranges | every beam with its state, metres |
| /scan | foxglove.LaserScan | the horizontal beams, FLU |
| /gyro | companion.Gyro | samples since the last message, rad/s clockwise |
| /estimate | companion.Pose | yaw and position with their sigmas, local NED |
| /pose, /tf | foxglove.Odometry, foxglove.FrameTransform | the same in ENU, with covariance |
| /setpoint | companion.Setpoint | velocity FRD and yaw rate; no message: no setpoint sent |
| /walls | foxglove.SceneUpdate | the present map, ENU |
| /phase | companion.Phase | the flight's phase by name and in words, and its trouble |
| /vehicle | companion.Vehicle | the autopilot's mode, whether it is armed, its battery |
| /faults, /autopilot | foxglove.Log | faults of flight and beams; the autopilot's texts |
| /config | companion.Config | the effective configuration |
| /earlier | NumPy archive | the map of earlier flights of the survey, lossless; needed for replay |
| /map | MessagePack | the final map, lossless |

All but the lossless ones are also published live; see `companion/view/foxglove_live.py`.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.message import Message
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import Writer
from mcap_protobuf.schema import build_file_descriptor_set

from companion.core.messages import Beam, Pose, Setpoint
from companion.core.values import value

INPUTS, RANGES, SCAN, GYRO = "/inputs", "/ranges", "/scan", "/gyro"
ESTIMATE, POSE, TF, SETPOINT = "/estimate", "/pose", "/tf", "/setpoint"
WALLS, PHASE, VEHICLE = "/walls", "/phase", "/vehicle"
FAULTS, AUTOPILOT = "/faults", "/autopilot"
CONFIG, EARLIER, MAP = "/config", "/earlier", "/map"

MESSAGE_PACK, NUMPY_ARCHIVE = "msgpack", "npz"
JsonSchema = Mapping[str, object]


@value
class PhaseRecord:
    """The flight's phase at one moment."""

    time_s: float
    phase: str
    """Its name in `companion/pdps/flight/phases.py`."""
    activity: str
    trouble: str


@value
class VehicleRecord:
    """The autopilot's state at one moment."""

    mode: str
    armed: bool
    battery: float | None
    """Remaining share, 0 to 1; None if not reported."""


_NUMBER: JsonSchema = {"type": "number"}
_TEXT: JsonSchema = {"type": "string"}
_FLAG: JsonSchema = {"type": "boolean"}


def _object(properties: Mapping[str, JsonSchema]) -> JsonSchema:
    return {"type": "object", "properties": properties}


_RANGE = _object({"state": _TEXT, "distance_m": _NUMBER, "variance_m2": _NUMBER})
_GYRO_SAMPLE = _object({"time_s": _NUMBER, "yaw_rate_rad_s": _NUMBER})

_PROTOBUF: Mapping[str, type[Message]] = {
    SCAN: LaserScan,
    POSE: Odometry,
    TF: FrameTransform,
    WALLS: SceneUpdate,
    FAULTS: Log,
    AUTOPILOT: Log,
}
_JSON: Mapping[str, tuple[str, JsonSchema]] = {
    RANGES: ("companion.Ranges", _object({beam.value: _RANGE for beam in Beam})),
    GYRO: ("companion.Gyro", _object({"samples": {"type": "array", "items": _GYRO_SAMPLE}})),
    ESTIMATE: ("companion.Pose", _object({field.name: _NUMBER for field in fields(Pose)})),
    SETPOINT: ("companion.Setpoint", _object({field.name: _NUMBER for field in fields(Setpoint)})),
    PHASE: (
        "companion.Phase",
        _object({"time_s": _NUMBER, "phase": _TEXT, "activity": _TEXT, "trouble": _TEXT}),
    ),
    VEHICLE: (
        "companion.Vehicle",
        _object({"mode": _TEXT, "armed": _FLAG, "battery": {"type": ["number", "null"]}}),
    ),
    CONFIG: ("companion.Config", _object({})),
}
_EXACT: Sequence[str] = (INPUTS, MAP)


@value
class Described:
    """A topic that other programs read, with the description of its messages."""

    topic: str
    message_encoding: str
    schema_name: str
    schema_encoding: str
    schema: bytes
    """A file descriptor set of protobuf, or a JSON schema."""


def described() -> Iterator[Described]:
    """The topics with a schema, which recordings and live streams have in common."""
    for topic, kind in _PROTOBUF.items():
        descriptors = build_file_descriptor_set(kind).SerializeToString()
        name = kind.DESCRIPTOR.full_name
        yield Described(topic, MessageEncoding.Protobuf, name, SchemaEncoding.Protobuf, descriptors)
    for topic, (name, properties) in _JSON.items():
        text = json.dumps(properties).encode()
        yield Described(topic, MessageEncoding.JSON, name, SchemaEncoding.JSONSchema, text)


def register(writer: Writer) -> dict[str, int]:
    """Register all topics with a writer; returns the channel of each."""
    channels = {}
    for each in described():
        schema = writer.register_schema(each.schema_name, each.schema_encoding, each.schema)
        channels[each.topic] = writer.register_channel(each.topic, each.message_encoding, schema)
    for topic in _EXACT:
        channels[topic] = writer.register_channel(topic, MESSAGE_PACK, 0)
    channels[EARLIER] = writer.register_channel(EARLIER, NUMPY_ARCHIVE, 0)
    return channels
