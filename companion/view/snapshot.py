"""Defines the snapshot of a flight that viewers receive, and its encoding."""

from collections.abc import Mapping
from dataclasses import field

from msgspec import msgpack

from companion.app import MAX_SKETCHED, App
from companion.config.settings import Config
from companion.core.messages import Beam, FloorPlan, Pose, RangeReading, Sketch
from companion.core.values import value
from companion.estimation.estimator import Estimator
from companion.team.teammate import Heard
from companion.ticks import Inputs, Outputs


@value
class Snapshot:
    """State of the companion at one time."""

    time_s: float
    activity: str
    trouble: str = ""
    has_ended: bool = False
    pose: Pose | None = None
    """None before the first estimate."""
    gyro_bias_rad_s: float | None = None
    readings: Mapping[Beam, RangeReading] = field(default_factory=dict)
    mount_offset_m: float = 0.0
    """Distance of the range sensors from the drone's centre, m."""
    sketch: Sketch | None = None
    """None: unchanged since the last snapshot with a map."""
    battery: float | None = None
    """Remaining charge, 0 to 1; None if the autopilot does not report it."""
    drone: int = 1
    """Number of the drone in its team."""
    mates: tuple[Heard, ...] = ()
    """The teammates that are heard."""


def snapshot(
    app: App,
    now_s: float,
    inputs: Inputs,
    outputs: Outputs,
    config: Config,
    *,
    with_sketch: bool,
) -> Snapshot:
    """Take a snapshot after a tick; the map is included if `with_sketch`."""
    flight = outputs.flight
    return Snapshot(
        now_s,
        flight.ending if outputs.finished else flight.activity,
        flight.trouble,
        outputs.finished,
        outputs.pose,
        _bias_rad_s(app.estimator),
        outputs.scan.readings,
        config.sensors.mount_offset_m,
        app.sketch() if with_sketch else None,
        inputs.telemetry.vehicle.battery,
        config.team.drone,
        app.team.mates.heard(now_s) if app.team else (),
    )


def _bias_rad_s(estimator: Estimator | None) -> float | None:
    return None if estimator is None else float(estimator.heading.bias_rad_s)


def sketch_of(plan: FloorPlan) -> Sketch:
    """Reduce a finished map for display, to at most `MAX_SKETCHED` hits."""
    stride = max(1, -(-len(plan.hits) // MAX_SKETCHED))
    points = tuple(hit.position_ned_m for hit in plan.hits[::stride])
    path = tuple((pose.north_m, pose.east_m, pose.down_m) for pose in plan.path)
    return Sketch(plan.walls, points, path, plan.ceiling_m)


_decoder = msgpack.Decoder(Snapshot)
encode = msgpack.Encoder().encode


def decode(data: bytes) -> Snapshot:
    """Decode a snapshot.

    Raises:
        msgspec.MsgspecError: the bytes are not a snapshot.
    """
    return _decoder.decode(data)
