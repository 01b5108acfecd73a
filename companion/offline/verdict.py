"""Decides whether a log supports the map made of it.

A map is trusted if it predicts ranges that it was not made from, and if it either does so better
than the map of the odometry as it is, or hardly differs from it. The odometry's errors must leave
its path well enough known (`path_error.py`).
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices
from companion.estimation.smoothing.factors import hit_residuals
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import ODOMETRY_SCALE, project
from companion.offline.growth import IncrementalMap
from companion.offline.held_out import mean_gain
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
MIN_BETTER = 0.95
"""Least probability that the map predicts ranges better than that of the odometry. Chosen: the
usual level. Of 25 public logs with references, it was reached by six of the seven whose path
improved, and by four of those whose path got worse, by 0.1 to 0.3 m."""
MAX_WALL_SIGMA_M = 0.25
"""Largest sigma of the wall of a hit, m, as a median. Chosen: 19 of 20 are then known to half a
metre. On those logs it was 0.01 to 0.11 m where the path was right to 0.4 m, with one exception
(0.6 m), and 0.25 to 0.6 m where it was off by one to two."""
CLOSE_M = 2 * MAX_WALL_SIGMA_M
"""A path that is closer to the odometry, m, needs no proof that it is better. Chosen: it is off by
no more than a trusted map may be."""
MAX_EXPECTED_ERROR_M = 1.0
"""Largest expected error of the path, m. Chosen: it is an upper bound, and the actual error is 0.4
of it. On public logs it was 0.1 to 0.8 m where the path was right to 0.3 m, with two exceptions
(1.0 and 1.4 m), and 1.0 to 6 m where a robot had turned without walls near."""
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
    wall_sigma_m: float
    """Sigma of the wall of a hit, as a median; infinite without hits on walls."""
    gain: float
    """Nats by which the map makes a held-out range more likely (`held_out.py`)."""
    motion_misfit: float
    """Root mean square of the odometry's residuals in its sigmas."""
    scale_error: float
    """Scale error of odometry or gyro, the larger one."""


@dataclass(frozen=True, slots=True)
class Correction:
    """How the path of a map differs from the odometry in the log."""

    mean_m: float
    """Mean distance from it."""
    is_better: float
    """Probability that the map predicts ranges better than that of the odometry."""
    expected_error_m: float
    """Expected error of the path (`path_error.py`)."""


@dataclass(frozen=True, slots=True)
class MapVerdict:
    """Verdict on a map."""

    trusted: bool
    reason: str
    better_than_odometry: float
    """Probability that the map is better than that of the odometry as it is."""
    expected_error_m: float
    """Expected error of the map's path."""

    @property
    def word(self) -> str:
        return "trusted" if self.trusted else "doubtful"


def agreement(solution: IncrementalMap, record: Record, gains: Array) -> Agreement:
    """Compute the agreement; `gains` (n,): of each held-out range, nats (`held_out.py`)."""
    x, m = solution.x, record.measured
    on_wall = np.flatnonzero(solution.wall_of != NO_WALL)
    wall = solution.wall_of[on_wall]
    across = (project(x, m).points[on_wall] * x.normals[wall]).sum(axis=1) - x.walls[wall, 1]
    residuals = hit_residuals(x, m, solution.wall_of, solution.smoother.models.ranges)
    lines = solution.estimate.wall_lines if solution.estimate else ()
    frames = np.zeros(len(x.poses), dtype=bool)
    for shift in range(-NEAR_KEYFRAMES, NEAR_KEYFRAMES + 1):
        frames[np.clip(m.frame[on_wall] + shift, 0, len(frames) - 1)] = True
    return Agreement(
        hits=len(m.beam),
        walls=len(x.walls),
        explained=len(on_wall) / max(len(m.beam), 1),
        wall_sigma_m=_median([line.sigma_m for line in lines], wall),
        gain=mean_gain(gains),
        rms_m=_rms(across),
        rms_sigmas=_rms(residuals),
        supported=float(frames.mean()),
        motion_misfit=solution.motion_misfit(),
        scale_error=float(np.abs(x.calibration[:, : ODOMETRY_SCALE + 1]).max()),
    )


def judge(found: Agreement, correction: Correction, axes: str | None = None) -> MapVerdict:
    """Judge the estimated map; `axes` as in `likelier_axes`."""
    share = f"{100 * found.explained:.0f} % of the ranges agree with the map"
    likelier = f"the map makes held-out ranges {math.exp(found.gain):.2f} times as likely"
    strain = f"{found.motion_misfit:.1f} sigmas RMS, scale error {100 * found.scale_error:.0f} %"
    objections = (
        (found.hits < MIN_HITS, f"only {found.hits} ranges"),
        (not found.walls, "no straight wall found"),
        (axes is not None, f"the axes of the log are probably others: it fits better with {axes}"),
        (
            found.gain < MIN_GAIN,
            f"only {share}, and {likelier}; the limit is {math.exp(MIN_GAIN):.2f}",
        ),
        (
            correction.is_better < MIN_BETTER and correction.mean_m > CLOSE_M,
            f"{share}, but it lies {correction.mean_m:.2f} m from the odometry, and the ranges do "
            f"not show that it is better: probability {100 * correction.is_better:.0f} %",
        ),
        (
            found.wall_sigma_m > MAX_WALL_SIGMA_M,
            f"{share}, but the walls are only known to {found.wall_sigma_m:.2f} m",
        ),
        (
            correction.expected_error_m > MAX_EXPECTED_ERROR_M,
            f"{share}, but between walls the odometry errs so much that the path is only known to "
            f"{correction.expected_error_m:.1f} m",
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
    return MapVerdict(
        reason is None, reason or share, correction.is_better, correction.expected_error_m
    )


def _median(sigma_m: list[float], wall: Indices) -> float:
    return float(np.median(np.array(sigma_m)[wall])) if len(wall) else math.inf


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean())) if len(values) else float("nan")
