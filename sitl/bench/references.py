"""Computes references for a flight: an ideal solver, and dead reckoning.

*Ideal*: least squares over the whole flight, started at the truth, with each hit associated with
the wall that its beam truly hit. Unknowns are poses, walls, scales, gyro bias and the range
sensors' gains. No estimator can do better from these measurements.

*Dead reckoning*: poses from odometry and the gyro with its rest calibration. Walls are fitted to
the same hits at those poses.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import wrap_rad
from companion.core.messages import FloorPlan, WallLine
from companion.estimation.association.gating import MIN_COS_INCIDENCE, NEAR_END_SIGMAS
from companion.estimation.association.pruning import Support
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import (
    NO_WALL,
    FlightRecord,
    FrameColumn,
    HitColumn,
)
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import Measured, Unknowns, project
from companion.estimation.solved_flight import SolvedFlight
from companion.mapping.floor_plan import wall_segments
from sitl.simulation.record import TruthRecord
from sitl.world.format import Segment

STEPS = 6
"""Iterations of the ideal solver."""
FARTHEST_SIGMAS = 5.0
"""A reading farther off than this does not belong to the wall that the beam truly hit. Chosen."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """The drone's measurements and calibration."""

    record: FlightRecord
    models: Models

    @property
    def measured(self) -> Measured:
        return self.models.measured(self.record)

    @property
    def unmoved(self) -> Unknowns:
        """Unknowns with all poses at the origin, and no walls."""
        return Unknowns.at(np.zeros((len(self.record.frames), 3)), self.models.rest_bias_rad_s)


@dataclass(frozen=True, slots=True)
class TruePoses:
    """Poses (n, 3), north, east and yaw, in the take-off frame."""

    poses: Array

    @classmethod
    def at(cls, truth: TruthRecord, times_s: Array) -> "TruePoses":
        known_s = [state.time_s for state in truth.path]
        points = np.array([state.position_ned_m[:2] for state in truth.path])
        yaws = np.unwrap([state.yaw_rad for state in truth.path])
        local = to_local(points, truth)
        columns = (local[:, 0], local[:, 1], yaws - truth.take_off.yaw_rad)
        return cls(np.column_stack([np.interp(times_s, known_s, column) for column in columns]))


def ideal(flown: Recorded, truth: TruthRecord, surfaces: Sequence[Segment]) -> FloorPlan:
    """Map and path of the ideal solver."""
    m = flown.measured
    walls, wall_of = _true_association(flown, m, truth, surfaces)
    x = flown.unmoved
    x.poses[:, :3] = TruePoses.at(truth, flown.record.frames[:, FrameColumn.TIME_S]).poses
    x.add_walls(walls, np.zeros_like(walls))
    smoother = Smoother(flown.models, Support())
    past = smoother.from_start(np.zeros(3))
    for _ in range(STEPS):
        smoother.step(x, m, wall_of, past)
    lines = tuple(WallLine(float(normal), float(offset), 0.0) for normal, offset in x.walls)
    return _plan(flown, x, lines, wall_of)


def dead_reckoned(flown: Recorded, plan: FloorPlan) -> FloorPlan:
    """The walls of `plan`, fitted to its hits at the poses of dead reckoning."""
    m, x = flown.measured, flown.unmoved
    turned = np.concatenate(
        [[0.0], np.cumsum(m.turned_rad - flown.models.rest_bias_rad_s * m.dt_s)]
    )
    cos, sin = np.cos(turned[:-1]), np.sin(turned[:-1])
    forward, right = m.moved_frd_m.T
    x.poses[1:, 0] = np.cumsum(cos * forward - sin * right)
    x.poses[1:, 1] = np.cumsum(sin * forward + cos * right)
    x.poses[:, 2] = turned
    points = project(x, m).points
    wall_of = np.array([NO_WALL if hit.wall is None else hit.wall for hit in plan.hits])
    lines = tuple(
        _line(points[wall_of == wall]) for wall in range(int(wall_of.max(initial=-1)) + 1)
    )
    return _plan(flown, x, lines, wall_of)


def _line(points: Array) -> WallLine:
    """Fit a line by total least squares; the side of its normal is arbitrary."""
    if len(points) < 2:
        return WallLine(0.0, 0.0, 0.0)
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre)[2][1]
    return WallLine(float(np.arctan2(normal[1], normal[0])), float(centre @ normal), 0.0)


def _true_association(
    flown: Recorded, m: Measured, truth: TruthRecord, surfaces: Sequence[Segment]
) -> tuple[Array, Indices]:
    """The true walls (w, 2), as in `Unknowns`, and the wall that each hit's beam hit, or -1."""
    units = flown.models.ranges
    taken_s = flown.record.hits[:, HitColumn.TIME_S] - units.age_s[m.beam]
    poses = TruePoses.at(truth, taken_s).poses
    bearing = poses[:, 2] + units.bearing_frd_rad[m.beam]
    beams = np.column_stack([np.cos(bearing), np.sin(bearing)])
    nearest = np.full(len(m.beam), np.inf)
    wall_of = np.full(len(m.beam), NO_WALL)
    walls: list[tuple[float, float]] = []
    for surface in surfaces:
        start, end = to_local(np.array(surface), truth)
        normal = np.array([start[1] - end[1], end[0] - start[0]]) / math.dist(start, end)
        for side in (normal, -normal):  # a partition has one wall per side
            met_m = range_m(poses[:, :2], beams, (start, end), side)
            hits = met_m < nearest
            nearest[hits] = met_m[hits]
            wall_of[hits] = _number(walls, side, float(start @ side))
    normals = np.array([(math.cos(alpha), math.sin(alpha)) for alpha, _ in walls])
    cos_incidence = (beams * normals[wall_of]).sum(axis=1)
    distance_m = nearest - m.mount_m
    sigma_m = units.sigma_m(m.beam, np.clip(distance_m, 0.0, units.max_m[m.beam]))
    usable = np.isfinite(nearest) & (cos_incidence > MIN_COS_INCIDENCE)
    usable &= distance_m > units.min_m[m.beam]
    usable &= distance_m < units.max_m[m.beam] - NEAR_END_SIGMAS * sigma_m
    usable &= np.abs(m.distance_m - distance_m) < FARTHEST_SIGMAS * sigma_m
    support = np.bincount(wall_of[usable], minlength=len(walls))
    usable &= support[wall_of] >= Support().hits
    used, renumbered = np.unique(wall_of[usable], return_inverse=True)
    wall_of = np.full(len(m.beam), NO_WALL)
    wall_of[usable] = renumbered
    return np.array(walls)[used], wall_of


def range_m(eyes: Array, beams: Array, segment: tuple[Array, Array], normal: Array) -> Array:
    """Range from each eye (n, 2) along its beam to the segment, m; inf if the beam misses."""
    start, end = segment
    towards = beams @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead_m = ((start - eyes) @ normal) / towards
        share = ((eyes + ahead_m[:, None] * beams - start) @ (end - start)) / math.dist(
            start, end
        ) ** 2
    hits = (towards > 0) & (ahead_m > 0) & (share >= 0) & (share <= 1)
    return np.where(hits, ahead_m, np.inf)


def _number(walls: list[tuple[float, float]], normal: Array, offset_m: float) -> int:
    """Number in `walls` of the wall on this line; a new one if necessary."""
    normal_rad = math.atan2(normal[1], normal[0])
    for i, (other_rad, other_m) in enumerate(walls):
        if abs(wrap_rad(normal_rad - other_rad)) < 1e-6 and abs(offset_m - other_m) < 1e-6:
            return i
    walls.append((normal_rad, offset_m))
    return len(walls) - 1


def _plan(flown: Recorded, x: Unknowns, lines: tuple[WallLine, ...], wall_of: Indices) -> FloorPlan:
    traced = SolvedFlight.of(flown.record, x, lines, wall_of, flown.models.ranges)
    walls = wall_segments(lines, traced.points_ne_m, wall_of)
    return FloorPlan(walls, traced.hits(), traced.path())


def to_local(points: Array, truth: TruthRecord) -> Array:
    """Transform world (north, east) to local NED by the true take-off pose."""
    yaw_rad = truth.take_off.yaw_rad
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    moved = points - np.array(truth.take_off.position_ned_m[:2])
    local: Array = moved @ np.array([[cos, -sin], [sin, cos]])
    return local
