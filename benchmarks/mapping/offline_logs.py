"""Generates logs with known truth: plans, flights through them, and readings of cheap sensors.

All is in the plane. Truth and logs share one frame: local NED, origin at the start of the log, x
along the first heading.
"""

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.messages import Beam
from sitl.core.truth import TrueState
from sitl.world.format import Segment

BEARING_RAD = {
    Beam.FRONT: 0.0,
    Beam.LEFT: -math.pi / 2,
    Beam.RIGHT: math.pi / 2,
    Beam.BACK: math.pi,
}
PERSON_RADIUS_M = 0.25


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise of sensors and odometry, as in the comparison with other mappers."""

    range_sigma_m: float = 0.05
    range_max_m: float = 5.5
    odometry_scale_sigma: float = 0.03
    odometry_step_m: float = 0.005
    gyro_bias_rad_s: float = math.radians(0.1)
    gyro_scale_sigma: float = 0.02
    outliers: float = 0.0
    """Share of readings that are random between zero and the maximum range."""
    dropouts: float = 0.0
    """Share of lost readings."""
    only_garbage: bool = False


@dataclass(frozen=True, slots=True)
class Flight:
    """Waypoints (north, east) in the plan's frame, flown nose first after a full turn."""

    waypoints_m: Sequence[Vector2]
    speed_m_s: float = 1.0
    turn_rate_rad_s: float = math.radians(45)
    rate_hz: float = 10.0
    spin_rad: float = math.tau


@dataclass(frozen=True, slots=True)
class Scenario:
    """A plan, a flight through it, and the sensors."""

    walls: Sequence[Segment]
    flight: Flight
    noise: Noise = Noise()
    beams: Sequence[Beam] = tuple(BEARING_RAD)
    people: Sequence[tuple[Vector2, Vector2]] = ()
    """Each walks back and forth between two places."""


@dataclass(frozen=True, slots=True)
class Log:
    """A recorded log, and the truth in the log's frame."""

    time_s: Array
    odometry: Array
    """(n, 3): x, y, yaw."""
    ranges_m: dict[Beam, Array] = field(default_factory=dict)
    """NaN without a return."""
    truth: Array = field(default_factory=lambda: np.empty((0, 3)))
    walls: Sequence[Segment] = ()
    gyro_rad_s: Array | None = None

    def until(self, end_s: float) -> "Log":
        """The rows before a time, s."""
        rows = slice(int(np.searchsorted(self.time_s, end_s)))
        return replace(
            self,
            time_s=self.time_s[rows],
            odometry=self.odometry[rows],
            ranges_m={beam: ranges_m[rows] for beam, ranges_m in self.ranges_m.items()},
            truth=self.truth[rows],
        )

    def true_states(self) -> list[TrueState]:
        """The truth in the scorer's format."""
        return [
            TrueState(time_s, (north, east, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, yaw, 0.0)
            for time_s, (north, east, yaw) in zip(
                self.time_s.tolist(), self.truth.tolist(), strict=True
            )
        ]


def record(scenario: Scenario, seed: int) -> Log:
    """Record one flight through the scenario."""
    random = np.random.default_rng(seed)
    time_s, truth = _fly(scenario.flight)
    odometry = _dead_reckon(time_s, truth, scenario.noise, random)
    walls = np.array(scenario.walls, dtype=float).reshape(-1, 2, 2)
    ranges = {}
    for beam in scenario.beams:
        distance_m = _cast(truth, BEARING_RAD[beam], walls)
        distance_m = np.minimum(distance_m, _to_people(time_s, truth, beam, scenario.people))
        ranges[beam] = _measured(distance_m, scenario.noise, random)
    start = truth[0]
    return Log(
        time_s,
        odometry,
        ranges,
        np.column_stack([_into(start, truth[:, :2]), truth[:, 2] - start[2]]),
        [(tuple(a), tuple(b)) for a, b in _into(start, walls).tolist()],
    )


def write_csv(log: Log, path: Path, gyro: bool = False) -> None:
    """Write the log in the format of `companion map`."""
    columns = [log.time_s, *log.odometry.T, *log.ranges_m.values()]
    names = ["time_s", "odom_x_m", "odom_y_m", "odom_yaw_rad", *(f"{b}_m" for b in log.ranges_m)]
    if gyro:
        columns.append(np.gradient(log.odometry[:, 2], log.time_s))
        names.append("gyro_z_rad_s")
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        for row in np.column_stack(columns).tolist():
            writer.writerow("" if math.isnan(value) else f"{value:.4f}" for value in row)


def _fly(flight: Flight) -> tuple[Array, Array]:
    """Times (n,) and true poses (n, 3): a full turn, then straight legs and turns."""
    here = np.array(flight.waypoints_m[0], dtype=float)
    yaw_rad = _bearing(flight.waypoints_m[0], flight.waypoints_m[1])
    dt_s = 1 / flight.rate_hz
    poses = [np.array([*here, yaw_rad])]

    def turn(angle_rad: float) -> None:
        steps = max(1, math.ceil(abs(angle_rad) / (flight.turn_rate_rad_s * dt_s) - 1e-9))
        start_rad = poses[-1][2]
        poses.extend(
            np.array([*poses[-1][:2], start_rad + angle_rad * (i + 1) / steps])
            for i in range(steps)
        )

    turn(flight.spin_rad)
    for target in flight.waypoints_m[1:]:
        leg_rad = _bearing((float(poses[-1][0]), float(poses[-1][1])), target)
        off_rad = math.remainder(leg_rad - poses[-1][2], math.tau)
        if abs(off_rad) > 1e-9:
            turn(off_rad)
        start = poses[-1].copy()
        steps = max(1, math.ceil(math.dist(start[:2], target) / (flight.speed_m_s * dt_s) - 1e-9))
        goal = np.array([*target, start[2]])
        poses.extend(start + (goal - start) * (i + 1) / steps for i in range(steps))
    return np.arange(len(poses)) / flight.rate_hz, np.array(poses, dtype=np.float64)


def _bearing(start: Vector2, end: Vector2) -> float:
    return math.atan2(end[1] - start[1], end[0] - start[0])


def _dead_reckon(time_s: Array, truth: Array, noise: Noise, random: np.random.Generator) -> Array:
    """Odometry (n, 3) from zero: body displacements and turns with their errors."""
    scale = 1 + random.normal(0, noise.odometry_scale_sigma)
    gyro_scale = 1 + random.normal(0, noise.gyro_scale_sigma)
    bias_rad_s = noise.gyro_bias_rad_s * random.choice([-1.0, 1.0])
    turned = np.diff(truth[:, 2])
    measured = gyro_scale * turned + bias_rad_s * np.diff(time_s)
    yaw = np.concatenate([[0.0], np.cumsum(measured)])
    moved = np.diff(truth[:, :2], axis=0)
    body = scale * _rotated(moved, -(truth[:-1, 2] + turned / 2))
    body += random.normal(0, noise.odometry_step_m, body.shape)
    steps = _rotated(body, yaw[:-1] + measured / 2)
    return np.column_stack([np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)]), yaw])


def _cast(poses: Array, bearing_rad: float, walls: Array) -> Array:
    """Distance (n,) along a beam from each pose to the nearest wall; inf without a wall."""
    heading = poses[:, 2] + bearing_rad
    ray = np.column_stack([np.cos(heading), np.sin(heading)])[:, None]
    start, along = walls[:, 0], walls[:, 1] - walls[:, 0]
    to_start = start - poses[:, None, :2]
    cross = ray[..., 0] * along[:, 1] - ray[..., 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (to_start[..., 0] * along[:, 1] - to_start[..., 1] * along[:, 0]) / cross
        share = (to_start[..., 0] * ray[..., 1] - to_start[..., 1] * ray[..., 0]) / cross
    met = (distance > 0) & (share >= 0) & (share <= 1)
    nearest: Array = np.where(met, distance, np.inf).min(axis=1, initial=np.inf)
    return nearest


def _to_people(
    time_s: Array, poses: Array, beam: Beam, people: Sequence[tuple[Vector2, Vector2]]
) -> Array:
    heading = poses[:, 2] + BEARING_RAD[beam]
    nearest = np.full(len(poses), np.inf)
    for number, (start, end) in enumerate(people):
        share = 0.5 - 0.5 * np.cos(time_s * 0.35 + number)
        place = np.array(start) + share[:, None] * (np.array(end) - np.array(start))
        ahead, aside = _rotated(place - poses[:, :2], -heading).T
        half_chord = np.sqrt(np.maximum(PERSON_RADIUS_M**2 - aside**2, 0.0))
        met = (np.abs(aside) < PERSON_RADIUS_M) & (ahead > PERSON_RADIUS_M)
        nearest = np.where(met, np.minimum(nearest, ahead - half_chord), nearest)
    return nearest


def _measured(distance_m: Array, noise: Noise, random: np.random.Generator) -> Array:
    if noise.only_garbage:
        return random.uniform(0.05, noise.range_max_m, len(distance_m))
    seen = distance_m + random.normal(0, noise.range_sigma_m, len(distance_m))
    wrong = random.random(len(seen)) < noise.outliers
    seen = np.where(wrong, random.uniform(0.05, noise.range_max_m, len(seen)), seen)
    lost = (random.random(len(seen)) < noise.dropouts) | (seen > noise.range_max_m) | (seen <= 0)
    measured: Array = np.where(lost, np.nan, seen)
    return measured


def _rotated(vectors: Array, angle_rad: Array | float) -> Array:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def _into(start: Array, points: Array) -> Array:
    """Points (..., 2) of the plan in the frame of the first pose."""
    return _rotated(points - start[:2], -float(start[2]))


def _ring(*corners: Vector2) -> list[Segment]:
    return [(a, b) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)]


def _box(north: float, east: float, deep: float, wide: float) -> list[Segment]:
    return _ring(
        (north, east), (north + deep, east), (north + deep, east + wide), (north, east + wide)
    )


def _loop(inset: float, size: float) -> list[Vector2]:
    near, far = inset, size - inset
    return [(near, near), (far, near), (far, far), (near, far), (near, near)]


ROOM = [*_ring((0, 0), (10, 0), (10, 10), (0, 10)), *_box(4, 4, 1.5, 2)]
L_SHAPE = _ring((0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10))
FURNITURE = [
    *_ring((0, 0), (8, 0), (8, 7), (0, 7)),
    *_box(0, 2.5, 0.6, 1.2), *_box(3, 0, 1.6, 0.5), *_box(7.4, 3, 0.6, 1.8),
    *_box(3.4, 2.8, 0.9, 1.5), *_box(6.2, 6.3, 0.8, 0.7), *_box(0.9, 6.6, 1.4, 0.4),
    *_ring((4.9, 4.9), (5.2, 5.2), (4.9, 5.5), (4.6, 5.2)),
]  # fmt: skip
TWO_ROOMS = [
    ((0, 0), (12, 0)), ((12, 0), (12, 6)), ((12, 6), (0, 6)), ((0, 6), (0, 0)),
    ((6, 0), (6, 2.5)), ((6, 3.5), (6, 6)), *_box(2.5, 2.6, 0.8, 0.8),
]  # fmt: skip
SLANTED = _ring((0, 0), (7, -1.5), (10, 4), (8, 9), (1, 8))

THROUGH_THE_DOOR = [
    (1.5, 1.5), (4.5, 1.5), (4.5, 3.0), (7.5, 3.0), (7.5, 1.5), (10.5, 1.5), (10.5, 4.5),
    (7.5, 4.5), (7.5, 3.0), (4.5, 3.0), (4.5, 4.5), (1.5, 4.5), (1.5, 1.5),
]  # fmt: skip

AROUND = Flight(_loop(1.5, 10))
SCENARIOS: dict[str, Callable[[], Scenario]] = {
    "room": lambda: Scenario(ROOM, AROUND),
    "room, 3 beams": lambda: Scenario(ROOM, AROUND, beams=(Beam.FRONT, Beam.LEFT, Beam.RIGHT)),
    "L-shaped": lambda: Scenario(
        L_SHAPE,
        Flight(
            [(1.5, 1.5), (8.5, 1.5), (8.5, 3.5), (3.5, 3.5), (3.5, 8.5), (1.5, 8.5), (1.5, 1.5)]
        ),
    ),
    "furniture, people": lambda: Scenario(
        FURNITURE,
        Flight([(1.6, 1.4), (6.4, 1.4), (6.2, 5.2), (2.2, 5.2), (1.6, 1.4), (2.4, 4.8)], 0.7),
        Noise(outliers=0.1, dropouts=0.1),
        people=(((2, 1), (7, 2)), ((6, 6), (2, 4))),
    ),
    "two rooms": lambda: Scenario(
        TWO_ROOMS,
        Flight(THROUGH_THE_DOOR),
    ),
    "sparse rows": lambda: Scenario(
        ROOM,
        Flight(AROUND.waypoints_m, rate_hz=1.0),
    ),
    "slanted walls": lambda: Scenario(
        SLANTED, Flight([(2, 1), (6.4, 0.2), (8.2, 3.8), (7, 7.2), (2.2, 6.6), (2, 1)])
    ),
    "garbage": lambda: Scenario(ROOM, AROUND, Noise(only_garbage=True)),
}
