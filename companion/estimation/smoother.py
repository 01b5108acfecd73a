"""The whole flight at once: the trajectory and walls that all measurements together make likeliest.

The filters must decide at every moment; a wall seen early can be set right by what was seen late.
Unknowns (`unknowns.py`), solved together by Gauss-Newton (`factors.py`, `bordered.py`):

    keyframes k: position p_k, heading ψ_k, gyro bias b_k
    gyro scale g, odometry scale s, gain error γ of each range unit
    walls i: direction of the normal α_i, offset ρ_i           wall i: {p : p·n(α_i) = ρ_i}

Which hit belongs to which wall is decided anew in every round, with an ever narrower gate
(`association.py`). A Cauchy weight keeps what still does not fit from pulling.
"""

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from companion.estimation import factors
from companion.estimation.association import LEAST_EXTENT_M, LEAST_HITS, associate
from companion.estimation.bordered import Solution
from companion.estimation.heading import GyroModel
from companion.estimation.keyframes import Keyframe, KeyframeHit
from companion.estimation.line_slam import OdometryModel
from companion.estimation.unknowns import (
    POSE_SIZE,
    WALL_SIZE,
    Array,
    Indices,
    Measured,
    RangeNoise,
    Unknowns,
    project,
)
from companion.estimation.wall_detection import Cloud, Look, detect_walls
from companion.frames import Vector2, wrap_rad
from companion.messages import Hit, Pose, RangeModel, WallLine

GATES_M = (0.6, 0.4, 0.3, 0.2, 0.1, 0.1, 0.05, 0.05, 0.05, 0.05)
"""How far off its wall a hit may be in each round, besides three sigmas."""
FLYING_GATES_M = (0.2, 0.1)
"""While it flies the filters start from the last smoothing and are not far off."""
DISCOVERY_GATE_M = 0.2
"""From this round on the poses are good enough to look for walls that the filters missed."""
STEPS_A_ROUND = 2


@dataclass(frozen=True, slots=True)
class Knowledge:
    """What is known at the last keyframe: all that the filters need to go on from there."""

    position_ne_m: Vector2
    yaw_rad: float
    bias_rad_s: float
    gyro_scale: float
    odometry_scale: float
    walls: Array
    """(w, 2): direction of the normal, offset."""
    reaches_m: Array
    """(w, 2): from where to where along (-sin, cos)(normal) each wall has been seen."""
    covariance: Array
    """Of north, east, yaw, bias, both scales, then of the walls, row by row."""


@dataclass(frozen=True, slots=True)
class Smoothed:
    """The flight as it most likely was."""

    walls: tuple[WallLine, ...]
    hits: tuple[Hit, ...]
    path: tuple[Pose, ...]
    end: Knowledge


class Smoother:
    """Smooths one flight; the result does not depend on anything but the record."""

    def __init__(
        self,
        sensor: RangeModel,
        mount_offset_m: float,
        rest_bias_rad_s: float,
    ) -> None:
        self._sensor = sensor
        self._mount_offset_m = mount_offset_m
        self._models = factors.Models(
            RangeNoise(sensor), rest_bias_rad_s, GyroModel(), OdometryModel()
        )

    def smooth(
        self,
        frames: Sequence[Keyframe],
        hits: Sequence[KeyframeHit],
        walls: Sequence[WallLine],
    ) -> Smoothed:
        """The likeliest flight, beginning from the filters' poses and walls."""
        work = self.smoothing(frames, hits, walls, GATES_M)
        while True:
            try:
                next(work)
            except StopIteration as end:
                smoothed: Smoothed = end.value
                return smoothed

    def smoothing(
        self,
        frames: Sequence[Keyframe],
        hits: Sequence[KeyframeHit],
        walls: Sequence[WallLine],
        gates_m: Sequence[float],
    ) -> Generator[None, None, Smoothed]:
        """The same in pieces of some milliseconds: it yields after each."""
        m = Measured.of(frames, hits, self._mount_offset_m)
        x = Unknowns.guessed(frames, walls, self._models.rest_bias_rad_s)
        for gate_m in gates_m:
            wall_of = associate(x, m, self._models.ranges, gate_m)
            yield
            if gate_m <= DISCOVERY_GATE_M and self._look_for_walls(x, m, wall_of):
                yield
                wall_of = associate(x, m, self._models.ranges, gate_m)
                yield
            for _ in range(STEPS_A_ROUND):
                solution = self.step(x, m, wall_of)
                yield
        points = project(x, m).points
        return Smoothed(
            _wall_lines(x, solution),
            tuple(map(self._hit, hits, points, wall_of)),
            tuple(map(_pose, frames, x.poses)),
            _knowledge(x, solution, points, wall_of),
        )

    def _look_for_walls(self, x: Unknowns, measured: Measured, wall_of: Indices) -> bool:
        """Walls that the filters missed, in the hits that belong to none; whether there are any."""
        loose = wall_of < 0
        seen = project(x, measured)
        beams = seen.beams[loose]
        cloud = Cloud(
            seen.points[loose],
            self._models.ranges.sigma_m(measured.distance_m[loose]),
            np.arctan2(beams[:, 1], beams[:, 0]),
        )
        found, _ = detect_walls(cloud, Look(LEAST_HITS, LEAST_EXTENT_M))
        x.walls = np.vstack([x.walls, found])
        return bool(len(found))

    def step(self, x: Unknowns, measured: Measured, wall_of: Indices) -> Solution:
        """One Gauss-Newton step of `x`, with the hits' walls as they are."""
        system = factors.new_system(x)
        factors.add_odometry(system, x, measured, self._models.odometry)
        factors.add_gyro(system, x, measured, self._models.gyro)
        factors.add_priors(system, x, self._models)
        factors.add_hits(system, x, measured, wall_of, self._models.ranges)
        solution = system.solve()
        shared = solution.shared
        x.poses += solution.chained.reshape(-1, POSE_SIZE)
        x.gyro_scale += float(shared[factors.GYRO_SCALE])
        x.odometry_scale += float(shared[factors.ODOMETRY_SCALE])
        x.range_gain += shared[factors.GAINS : factors.WALLS]
        x.walls += shared[factors.WALLS :].reshape(-1, WALL_SIZE)
        return solution

    def _hit(self, hit: KeyframeHit, point: Array, wall: int) -> Hit:
        sigma_m = self._sensor.sigma_m(max(hit.range_m - self._mount_offset_m, self._sensor.min_m))
        position_ned_m = (float(point[0]), float(point[1]), hit.down_m)
        on_wall = int(wall) if wall >= 0 else None
        return Hit(hit.time_s, hit.beam, position_ned_m, sigma_m**2, on_wall)


def _pose(frame: Keyframe, pose: Array) -> Pose:
    north_m, east_m, yaw_rad, _ = map(float, pose)
    return replace(frame.guess, north_m=north_m, east_m=east_m, yaw_rad=wrap_rad(yaw_rad))


def _wall_lines(x: Unknowns, solution: Solution) -> tuple[WallLine, ...]:
    """With their sigmas where direction and offset are independent: at cov(α, ρ) / var(α)."""
    lines = []
    for i, (normal_rad, offset_m) in enumerate(x.walls):
        at = factors.WALLS + WALL_SIZE * i
        (direction, both), (_, offset) = solution.shared_covariance[at : at + 2, at : at + 2]
        variance_m2 = max(offset - both**2 / direction, 0.0)
        lines.append(
            WallLine(
                float(normal_rad),
                float(offset_m),
                math.sqrt(variance_m2),
                math.sqrt(direction),
                float(both / direction),
            )
        )
    return tuple(lines)


def _knowledge(x: Unknowns, solution: Solution, points: Array, wall_of: Indices) -> Knowledge:
    north_m, east_m, yaw_rad, bias_rad_s = map(float, x.poses[-1])
    covariance = solution.covariance_of_last(POSE_SIZE)
    gains = POSE_SIZE + np.arange(factors.GAINS, factors.WALLS)
    kept = np.delete(np.arange(len(covariance)), gains)
    along = points @ np.array([-np.sin(x.walls[:, 0]), np.cos(x.walls[:, 0])])
    reaches = [
        (mine.min(), mine.max())
        for wall in range(len(x.walls))
        if len(mine := along[wall_of == wall, wall])
    ]
    return Knowledge(
        (north_m, east_m),
        yaw_rad,
        bias_rad_s,
        x.gyro_scale,
        x.odometry_scale,
        x.walls,
        np.array(reaches).reshape(-1, 2),
        covariance[np.ix_(kept, kept)],
    )
