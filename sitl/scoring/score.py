"""Scores map and flight against the ground truth. Every score is defined only here.

The map is in its own frame, local NED with its origin at take-off. The true take-off pose
transforms it to the world frame. *Aligned* scores first fit the map rigidly to the true walls. This
removes the error of the take-off pose and leaves the error of the map's shape.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from evo.core import metrics, sync
from evo.core.geometry import GeometryException
from evo.core.trajectory import PoseTrajectory3D
from scipy.spatial import cKDTree

from companion.core.arrays import Array
from companion.core.messages import FloorPlan, Pose
from sitl.core.truth import TrueState
from sitl.world.format import Segment
from sitl.world.geometry.nearest import NearestWall
from sitl.world.plan import samples

COVERED_WITHIN_M = 0.10
"""A true wall is covered if a mapped wall is within this, m."""
FALSE_BEYOND_M = 0.20
"""A mapped wall is false beyond this distance from all true walls, m."""
PASSAGE_M, EITHER_SIDE_COS = 1.2, -0.1
"""A passage is narrower than this, m, between surfaces in directions with this cosine or less. The
drone may pass closer there, as in a door."""
ALIGNMENT_STEPS = 30
"""Largest number of iterations."""
ALIGNMENT_REACH_M = 1.0
"""Samples farther than this from any true wall do not affect the alignment, m."""


@dataclass(frozen=True, slots=True)
class MapScore:
    """Scores of a map: wall errors in cm, shares from 0 to 1."""

    wall_error_cm: float
    wall_error_p95_cm: float
    wall_error_aligned_cm: float
    wall_error_aligned_p95_cm: float
    coverage: float
    """Share of the observable true walls that have a mapped wall within 10 cm, aligned."""
    false_walls: float
    """Share of the mapped length farther than 20 cm from any true wall, aligned."""
    wall_sigma_cm: float
    """Mean standard deviation of the map's walls at their middles, weighted by length."""
    wall_error_sigmas: float
    """RMS distance of the walls' middles to the nearest true wall, take-off frame, in their sigmas.

    About 1 if the map's sigmas are consistent. False walls are excluded.
    """


NOTHING_MAPPED = MapScore(math.inf, math.inf, math.inf, math.inf, 0.0, 0.0, math.inf, math.inf)
"""Score of a map without a wall that counts."""


@dataclass(frozen=True, slots=True)
class TrajectoryScore:
    """Absolute trajectory error (ATE), RMSE in cm: aligned rigidly, and in the take-off frame."""

    ate_cm: float
    ate_take_off_frame_cm: float


def score_map(
    plan: FloorPlan,
    surfaces: Sequence[Segment],
    observable: Array,
    take_off: TrueState,
    closed: Sequence[Segment] = (),
) -> MapScore:
    """Compare the mapped walls with the true ones (world frame, north and east, m).

    `observable` are samples (n, 2) of the observable surfaces, for the coverage. `closed` are walls
    that the simulator added at the border to the unknown: mapped walls there do not count.
    """
    truth = _Truth(surfaces, closed)
    mapped = to_world(samples([(w.start_ne_m, w.end_ne_m) for w in plan.walls]), take_off)
    error_m = _those_that_count(truth.errors_m(mapped))
    if not len(error_m):
        return NOTHING_MAPPED
    aligned = align(mapped, truth.standing)
    aligned_error_m = _those_that_count(truth.errors_m(aligned))
    if not len(aligned_error_m):
        return NOTHING_MAPPED
    covered = _distance_to_points(observable, aligned) <= COVERED_WITHIN_M
    return MapScore(
        wall_error_cm=100 * float(error_m.mean()),
        wall_error_p95_cm=100 * float(np.percentile(error_m, 95)),
        wall_error_aligned_cm=100 * float(aligned_error_m.mean()),
        wall_error_aligned_p95_cm=100 * float(np.percentile(aligned_error_m, 95)),
        coverage=float(covered.mean()) if len(covered) else 0.0,
        false_walls=float((aligned_error_m > FALSE_BEYOND_M).mean()),
        wall_sigma_cm=100 * _mean_sigma_m(plan),
        wall_error_sigmas=_error_in_sigmas(plan, truth, take_off),
    )


class _Truth:
    """The true walls, and the simulator's walls at the border to the unknown."""

    def __init__(self, surfaces: Sequence[Segment], closed: Sequence[Segment]) -> None:
        self._walls = _nearest_of(surfaces)
        self._closed = _nearest_of(closed) if closed else None
        self.standing = _nearest_of([*surfaces, *closed]) if closed else self._walls
        """All surfaces that a beam can hit; the map is aligned to them."""

    def errors_m(self, points: Array) -> Array:
        """Distance of each point (n, 2) to the true walls, m; NaN where it does not count.

        A point does not count if it is nearer to the closed border than to a true wall.
        """
        error_m, _ = self._walls.query(points)
        if self._closed is None:
            return error_m
        closed_m, _ = self._closed.query(points)
        return np.where((closed_m <= FALSE_BEYOND_M) & (closed_m < error_m), math.nan, error_m)


def _those_that_count(errors_m: Array) -> Array:
    return errors_m[~np.isnan(errors_m)]


def _nearest_of(segments: Sequence[Segment]) -> NearestWall:
    return NearestWall(np.array(segments, dtype=float).reshape(-1, 2, 2))


def _mean_sigma_m(plan: FloorPlan) -> float:
    lengths_m = [wall.length_m for wall in plan.walls]
    return float(np.average([wall.sigma_m for wall in plan.walls], weights=lengths_m))


def _error_in_sigmas(plan: FloorPlan, truth: _Truth, take_off: TrueState) -> float:
    middles = np.array([np.add(wall.start_ne_m, wall.end_ne_m) / 2 for wall in plan.walls])
    error_m = truth.errors_m(to_world(middles, take_off))
    sigma_m = np.array([wall.sigma_m for wall in plan.walls])
    counts = (error_m < FALSE_BEYOND_M) & (sigma_m > 0)
    return (
        float(np.sqrt(np.mean((error_m[counts] / sigma_m[counts]) ** 2))) if counts.any() else 0.0
    )


def score_trajectory(
    path: Sequence[Pose], truth: Sequence[TrueState], take_off: TrueState
) -> TrajectoryScore:
    """ATE by evo, against the ground truth interpolated to the times of the poses."""
    truth = _at_times(truth, [pose.time_s for pose in path])
    estimated = _trajectory(
        [pose.time_s for pose in path],
        to_world(np.array([[pose.north_m, pose.east_m] for pose in path]), take_off),
        [pose.yaw_rad + take_off.yaw_rad for pose in path],
    )
    true = _trajectory(
        [state.time_s for state in truth],
        np.array([state.position_ned_m[:2] for state in truth]),
        [state.yaw_rad for state in truth],
    )
    true, estimated = sync.associate_trajectories(true, estimated, max_diff=0.001)
    as_is_cm = _rmse_cm(true, estimated)
    try:
        estimated.align(true)
    except GeometryException:  # the drone never moved
        return TrajectoryScore(as_is_cm, as_is_cm)
    return TrajectoryScore(ate_cm=_rmse_cm(true, estimated), ate_take_off_frame_cm=as_is_cm)


def clear_in_the_open_m(surfaces: Sequence[Segment], places: Array, radius_m: float) -> float:
    """Smallest distance of a body's hull to any surface, outside passages, m.

    `places` (n, 2) are the body's positions. Infinite if all are in passages or there is no
    surface.
    """
    walls = np.array(surfaces, dtype=float).reshape(-1, 2, 2)
    if not len(walls) or not len(places):
        return math.inf
    least_m = math.inf
    for place in places[NearestWall(walls).query(places)[0].argsort()]:
        foot = _feet(place[None], walls)[0] - place
        away_m = np.hypot(*foot.T)
        nearest = int(away_m.argmin())
        if away_m[nearest] - radius_m >= least_m:
            break
        towards = foot / np.maximum(away_m, 1e-9)[:, None]
        other_side = foot[towards @ towards[nearest] < EITHER_SIDE_COS]
        across_m = np.hypot(*(other_side - foot[nearest]).T)
        if across_m.min(initial=math.inf) >= PASSAGE_M:
            least_m = float(away_m[nearest]) - radius_m
    return least_m


def least_time_s(surfaces: Sequence[Segment], standoff_m: float, speed_m_s: float) -> float:
    """Shortest time to trace a room with four square corners: (P - 8·d) / v, s."""
    perimeter_m = sum(math.dist(*surface) for surface in surfaces)
    return max(perimeter_m - 8 * standoff_m, 0.0) / speed_m_s


def align(points: Array, walls: NearestWall) -> Array:
    """Fit points (n, 2) rigidly to walls by iterated closest points."""
    for _ in range(ALIGNMENT_STEPS):
        distance_m, nearest = walls.query(points)
        pull = distance_m < ALIGNMENT_REACH_M
        if pull.sum() < 3:
            return points
        moved = _rigid_fit(points[pull], nearest[pull], points)
        if float(np.abs(moved - points).max()) < 1e-5:
            return moved
        points = moved
    return points


def _rigid_fit(source: Array, target: Array, points: Array) -> Array:
    """Apply the rotation and shift that map `source` to `target` (Kabsch) to `points`."""
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((source - source_mean).T @ (target - target_mean))
    flip = np.diag([1.0, np.sign(np.linalg.det(u @ vt))])
    moved: Array = (points - source_mean) @ (u @ flip @ vt) + target_mean
    return moved


def to_world(points: Array, take_off: TrueState) -> Array:
    """Transform local NED (north, east) to the world frame by the true take-off pose."""
    cos_yaw, sin_yaw = math.cos(take_off.yaw_rad), math.sin(take_off.yaw_rad)
    rotation = np.array([[cos_yaw, sin_yaw], [-sin_yaw, cos_yaw]])
    moved: Array = points @ rotation + np.array(take_off.position_ned_m[:2])
    return moved


def _feet(points: Array, walls: Array) -> Array:
    """Closest points (n, m, 2) on each of the segments (m, 2, 2)."""
    start, along = walls[:, 0], walls[:, 1] - walls[:, 0]
    length2 = np.maximum((along**2).sum(axis=1), 1e-12)
    share = ((points[:, None] - start) * along).sum(axis=2) / length2
    feet: Array = start + np.clip(share, 0, 1)[..., None] * along
    return feet


def _distance_to_points(points: Array, others: Array) -> Array:
    nearest: Array = cKDTree(others).query(points)[0]
    return nearest


def _at_times(truth: Sequence[TrueState], times_s: Sequence[float]) -> list[TrueState]:
    """The true states at these times, linearly interpolated; none outside the record.

    Using the nearest state would add the motion within half a recording period.
    """
    known_s = [state.time_s for state in truth]
    within = [time_s for time_s in times_s if known_s[0] <= time_s <= known_s[-1]]
    north, east, down = (
        np.interp(within, known_s, [state.position_ned_m[axis] for state in truth])
        for axis in range(3)
    )
    yaw = np.interp(within, known_s, np.unwrap([state.yaw_rad for state in truth]))
    return [
        replace(
            truth[0],
            time_s=time_s,
            position_ned_m=(float(north[i]), float(east[i]), float(down[i])),
            yaw_rad=float(yaw[i]),
        )
        for i, time_s in enumerate(within)
    ]


def _trajectory(time_s: Sequence[float], xy: Array, yaw_rad: Sequence[float]) -> PoseTrajectory3D:
    half = np.array(yaw_rad) / 2
    zero = np.zeros(len(half))
    return PoseTrajectory3D(
        positions_xyz=np.column_stack([xy, zero]),
        orientations_quat_wxyz=np.column_stack([np.cos(half), zero, zero, np.sin(half)]),
        timestamps=np.array(time_s),
    )


def _rmse_cm(true: PoseTrajectory3D, estimated: PoseTrajectory3D) -> float:
    error = metrics.APE(metrics.PoseRelation.translation_part)
    error.process_data((true, estimated))
    return 100 * float(error.get_statistic(metrics.StatisticsType.rmse))
