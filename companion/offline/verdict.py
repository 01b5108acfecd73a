"""Decides whether a log supports the map made of it."""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array
from companion.estimation.smoothing.factors import hit_residuals
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import ODOMETRY_SCALE, project
from companion.offline.growth import IncrementalMap
from companion.offline.held_out import gain
from companion.offline.record import Record

MIN_GAIN = 0.3
"""Least gain, nats per range: the map makes a held-out range 1.35 times as likely as its beam's own
distribution does.

Chosen by 175 logs. With ranges shuffled in time, delayed or of another beam the gain is 0 to
0.24. With a correct path it is 0.3 to 1.3 in nine of ten, and with an error of a metre mostly
less."""
MIN_HITS = 30
"""Least hits of a trusted map. Chosen."""
MAX_MOTION_MISFIT = 3.0
"""Largest RMS residual of the odometry, in sigmas. Chosen."""
MAX_SCALE_ERROR = 0.3
"""Largest scale error. Chosen: beyond it ranges or odometry are in another unit."""
MIN_SUPPORTED = 0.3
"""Least share of keyframes near hits on walls. Chosen."""
NEAR_KEYFRAMES = 25
"""A keyframe is supported by a hit on a wall within this many keyframes. Chosen."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """Agreement of hits with the walls of a map, and of its trajectory with the odometry."""

    hits: int
    walls: int
    explained: float
    """Share of the hits that are on a wall."""
    rms_m: float
    """RMS distance of those hits from their walls; NaN without any."""
    rms_sigmas: float
    """The same in sigmas of the ranges."""
    supported: float
    """Share of the keyframes with a hit on a wall nearby."""
    gain: float
    """Nats by which the map makes a held-out range more likely (`held_out.py`)."""
    motion_misfit: float
    """Root mean square of the odometry's residuals in its sigmas."""
    scale_error: float
    """Scale error of odometry or gyro, the larger one."""


@dataclass(frozen=True, slots=True)
class MapVerdict:
    """Verdict on a map."""

    trusted: bool
    reason: str

    @property
    def word(self) -> str:
        return "trusted" if self.trusted else "doubtful"


def agreement(solution: IncrementalMap, record: Record, units: RangeUnits) -> Agreement:
    """Compute the agreement; `units` contain the noise by which held-out ranges are predicted."""
    x, m = solution.x, record.measured
    on_wall = np.flatnonzero(solution.wall_of != NO_WALL)
    wall = solution.wall_of[on_wall]
    across = (project(x, m).points[on_wall] * x.normals[wall]).sum(axis=1) - x.walls[wall, 1]
    residuals = hit_residuals(x, m, solution.wall_of, solution.smoother.models.ranges)
    frames = np.zeros(len(x.poses), dtype=bool)
    for shift in range(-NEAR_KEYFRAMES, NEAR_KEYFRAMES + 1):
        frames[np.clip(m.frame[on_wall] + shift, 0, len(frames) - 1)] = True
    return Agreement(
        hits=len(m.beam),
        walls=len(x.walls),
        explained=len(on_wall) / max(len(m.beam), 1),
        gain=gain(solution, m, units),
        rms_m=_rms(across),
        rms_sigmas=_rms(residuals),
        supported=float(frames.mean()),
        motion_misfit=solution.motion_misfit(),
        scale_error=float(np.abs(x.calibration[:, : ODOMETRY_SCALE + 1]).max()),
    )


def judge(found: Agreement, uncorrected: Agreement) -> MapVerdict:
    """Judge the estimated map against the one by uncorrected odometry."""
    share = f"{100 * found.explained:.0f} % of the ranges agree with the map"
    likelier = f"the map makes held-out ranges {math.exp(found.gain):.2f} times as likely"
    strain = f"{found.motion_misfit:.1f} sigmas RMS, scale error {100 * found.scale_error:.0f} %"
    objections = (
        (found.hits < MIN_HITS, f"only {found.hits} ranges"),
        (not found.walls, "no straight wall found"),
        (
            found.gain < MIN_GAIN,
            f"only {share}, and {likelier}; the limit is {math.exp(MIN_GAIN):.2f}",
        ),
        (
            found.gain < uncorrected.gain - MIN_GAIN,
            f"{share}, but {likelier}, and the map of the uncorrected odometry "
            f"{math.exp(uncorrected.gain):.2f} times",
        ),
        (
            found.supported < MIN_SUPPORTED,
            f"hits on walls in only {100 * found.supported:.0f} % of the time",
        ),
        (
            found.motion_misfit > MAX_MOTION_MISFIT or found.scale_error > MAX_SCALE_ERROR,
            f"the walls contradict the odometry: {strain}",
        ),
    )
    reason = next((reason for applies, reason in objections if applies), None)
    return MapVerdict(reason is None, reason or share)


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean())) if len(values) else float("nan")
