"""Whether a log supports the map made of it, and by what that is known."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.estimation.smoothing.factors import hit_residuals
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import project
from companion.offline.growth import Growth
from companion.offline.held_out import gain
from companion.offline.record import Record

MIN_GAIN = 0.3
"""Nats a range: with the map it is 1.35 times as likely as by what its beam tells on the whole.

Chosen, on 175 logs. With ranges shuffled in time, late or of another beam it is 0 to 0.24. Where
the path is right it is 0.3 to 1.3 in nine of ten, and where it is a metre off mostly less.
"""
MIN_HITS = 30
MAX_MOTION_MISFIT = 3.0
MAX_SCALE_ERROR = 0.3
MIN_SUPPORTED = 0.3
NEAR_KEYFRAMES = 25
"""A key frame is supported if a hit on a wall is this near in the record."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """Of hits with the walls of a map, and of its trajectory with the odometry."""

    hits: int
    walls: int
    explained: float
    """Share of the hits that lie on a wall."""
    rms_m: float
    """Of those hits' distances from their walls; NaN if there are none."""
    rms_sigmas: float
    """The same in sigmas of the ranges."""
    supported: float
    """Share of the key frames with a hit on a wall nearby."""
    gain: float
    """Nats by which the map makes a range likelier that it was not made from (`held_out.py`)."""
    motion_misfit: float
    """Root mean square of the odometry's residuals in its sigmas."""
    scale_error: float
    """Of the odometry or the gyro, whichever is larger."""


@dataclass(frozen=True, slots=True)
class MapVerdict:
    """What to think of a result."""

    trusted: bool
    reason: str

    @property
    def word(self) -> str:
        return "trusted" if self.trusted else "doubtful"


def agreement(growth: Growth, record: Record, units: RangeUnits) -> Agreement:
    """How well it all fits together; `units` tell the noise by which ranges are predicted."""
    x, m = growth.x, record.measured
    mine = np.flatnonzero(growth.wall_of != NO_WALL)
    wall = growth.wall_of[mine]
    across = (project(x, m).points[mine] * x.normals[wall]).sum(axis=1) - x.walls[wall, 1]
    off = hit_residuals(x, m, growth.wall_of, growth.smoother.models.ranges)
    frames = np.zeros(len(x.poses), dtype=bool)
    for shift in range(-NEAR_KEYFRAMES, NEAR_KEYFRAMES + 1):
        frames[np.clip(m.frame[mine] + shift, 0, len(frames) - 1)] = True
    return Agreement(
        hits=len(m.beam),
        walls=len(x.walls),
        explained=len(mine) / max(len(m.beam), 1),
        gain=gain(growth, m, units),
        rms_m=_rms(across),
        rms_sigmas=_rms(off),
        supported=float(frames.mean()),
        motion_misfit=growth.motion_misfit(),
        scale_error=max(abs(x.odometry_scale), abs(x.gyro_scale)),
    )


def judge(found: Agreement, told: Agreement) -> MapVerdict:
    """Of the map found, against the one that the odometry as it was told would make."""
    share = f"{100 * found.explained:.0f} % of the ranges agree with the map"
    likelier = f"ranges that it was not made from are {math.exp(found.gain):.2f} times as likely"
    strain = (
        f"{found.motion_misfit:.1f} of its sigmas, scale off by {100 * found.scale_error:.0f} %"
    )
    objections = (
        (found.hits < MIN_HITS, f"only {found.hits} ranges to go by"),
        (not found.walls, "no straight wall found"),
        (
            found.gain < MIN_GAIN,
            f"only {share}, and {likelier} with it; {math.exp(MIN_GAIN):.2f} times they should",
        ),
        (
            found.gain < told.gain - MIN_GAIN,
            f"{share}, but {likelier} with it, and {math.exp(told.gain):.2f} times with that of "
            "the odometry as it is",
        ),
        (
            found.supported < MIN_SUPPORTED,
            f"walls are near in only {100 * found.supported:.0f} % of the time",
        ),
        (
            found.motion_misfit > MAX_MOTION_MISFIT or found.scale_error > MAX_SCALE_ERROR,
            f"the walls contradict the odometry: {strain}",
        ),
    )
    reason = next((reason for applies, reason in objections if applies), None)
    return MapVerdict(reason is None, reason or share)


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt((values**2).mean())) if len(values) else float("nan")
