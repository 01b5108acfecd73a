"""One moment of a flight, for people who look on, and its bytes."""

from collections.abc import Mapping
from dataclasses import field

from msgspec import msgpack

from companion.app import MAX_SKETCHED, App, Outputs
from companion.core.messages import Beam, FloorPlan, Pose, RangeReading, Sketch
from companion.core.values import value
from companion.estimation.estimator import Estimator


@value
class Snapshot:
    """What the companion knows and does at one moment."""

    time_s: float
    activity: str
    trouble: str = ""
    has_ended: bool = False
    pose: Pose | None = None
    """None before the estimate has begun."""
    gyro_bias_rad_s: float | None = None
    readings: Mapping[Beam, RangeReading] = field(default_factory=dict)
    mount_offset_m: float = 0.0
    """Of the sensors from the drone's centre."""
    sketch: Sketch | None = None
    """None: as it was."""


def snapshot(
    app: App, now_s: float, outputs: Outputs, mount_offset_m: float, *, with_sketch: bool
) -> Snapshot:
    """After a tick."""
    flight = outputs.flight
    return Snapshot(
        now_s,
        flight.ending if outputs.finished else flight.activity,
        flight.trouble,
        outputs.finished,
        outputs.pose,
        _bias_rad_s(app.estimator),
        outputs.scan.readings,
        mount_offset_m,
        app.sketch() if with_sketch else None,
    )


def _bias_rad_s(estimator: Estimator | None) -> float | None:
    return None if estimator is None else float(estimator.heading.bias_rad_s)


def sketch_of(plan: FloorPlan) -> Sketch:
    """A finished map, for the eye."""
    stride = max(1, -(-len(plan.hits) // MAX_SKETCHED))
    points = tuple(hit.position_ned_m for hit in plan.hits[::stride])
    path = tuple((pose.north_m, pose.east_m, pose.down_m) for pose in plan.path)
    return Sketch(plan.walls, points, path, plan.ceiling_m)


_decoder = msgpack.Decoder(Snapshot)
encode = msgpack.Encoder().encode


def decode(data: bytes) -> Snapshot:
    """Raises msgspec.MsgspecError if these are not the bytes of a snapshot."""
    return _decoder.decode(data)
