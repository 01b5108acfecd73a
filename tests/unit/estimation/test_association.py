"""Association of hits with walls, in rooms of a few segments flown past with known poses."""

import math
from collections.abc import Sequence
from itertools import pairwise
from random import Random

import numpy as np
import pytest

from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.messages import BEARING_FRD_RAD, Beam, Pose, RangeUnit, WallSegment
from companion.drivers.chips.sharp import GP2Y0A710K0F
from companion.estimation.association.association import Association
from companion.estimation.association.pruning import Support
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import NO_WALL, FlightRecord
from companion.estimation.smoothing.odometry_model import OdometryModel
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits
from companion.estimation.smoothing.smoother import FINAL_GATES, Smoother
from companion.estimation.smoothing.state import Measured, Unknowns, project
from companion.mapping.floor_plan import wall_segments

Segment = tuple[Vector2, Vector2]
UNITS = RangeUnits({b: RangeUnit(GP2Y0A710K0F, at, 0.0) for b, at in BEARING_FRD_RAD.items()})


def beam_range_m(origin_ne_m: Vector2, bearing_rad: float, segments: Array) -> float:
    """Range of a beam to the nearest of segments (n, 4), m."""
    cos, sin = math.cos(bearing_rad), math.sin(bearing_rad)
    from_n, from_e = segments[:, 0] - origin_ne_m[0], segments[:, 1] - origin_ne_m[1]
    dn, de = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    cross = cos * de - sin * dn
    cross[np.abs(cross) < 1e-9] = math.nan
    along, share = (from_n * de - from_e * dn) / cross, (from_n * sin - from_e * cos) / cross
    is_met = (along > 0) & (share >= 0) & (share <= 1)
    return float(along[is_met].min(initial=math.inf))


def fly(segments: Sequence[Segment], path: Sequence[Vector2], seed: int) -> FlightRecord:
    """Fly along a path at 1 m/s facing north, with one full turn at each of its points."""
    random, record, time_s = Random(seed), FlightRecord(), 0.0
    ends = np.array(segments, dtype=float).reshape(-1, 4)

    def record_sweep(place: Vector2, yaw_rad: float) -> None:
        nonlocal time_s
        time_s += 0.05
        pose = Pose(time_s, *place, -1.2, yaw_rad)
        record.advance(pose, place, yaw_rad)
        for beam, bearing_rad in BEARING_FRD_RAD.items():
            true_m = beam_range_m(place, yaw_rad + bearing_rad, ends)
            if not 1.0 < true_m < 5.5:
                continue
            reading_m = true_m + random.gauss(0, GP2Y0A710K0F.sigma_m(true_m))
            if 1.0 < reading_m < 5.5:
                record.add_hit(pose, BEAMS.index(beam), reading_m, ((0.0, 0.0), bearing_rad), None)

    for turns, (start, end) in enumerate(pairwise(path)):
        for degrees in range(0, 360, 3):
            record_sweep(start, turns * math.tau + math.radians(degrees))
        steps = max(1, round(math.dist(start, end) / 0.05))
        for i in range(steps):
            share = i / steps
            record_sweep(
                (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])),
                (turns + 1) * math.tau,
            )
    return record


def mapped(record: FlightRecord) -> Estimate:
    """Solution that starts from the true poses, without walls."""
    smoother = Smoother(Models(UNITS), Support())
    x = Unknowns.at(record.poses.copy(), 0.0)
    start = smoother.from_start(record.poses[0].copy())
    return smoother.smooth(x, Measured.of(record, UNITS), start, FINAL_GATES)


def walls_of(estimate: Estimate, record: FlightRecord) -> tuple[WallSegment, ...]:
    points = project(estimate.x, Measured.of(record, UNITS)).points
    return wall_segments(estimate.wall_lines, points, estimate.wall_of)


def closed(*corners: Vector2) -> list[Segment]:
    return list(zip(corners, (*corners[1:], corners[0]), strict=True))


def wall_errors_m(walls: Sequence[WallSegment], segments: Sequence[Segment]) -> Array:
    """Distances of points every 5 cm along the mapped walls from the nearest true wall, m."""
    return np.array(
        [
            min(_distance_m(point, segment) for segment in segments)
            for wall in walls
            for point in np.linspace(wall.start_ne_m, wall.end_ne_m, round(wall.length_m / 0.05))
        ]
    )


def _distance_m(point: Array, segment: Segment) -> float:
    a, b = (np.array(end) for end in segment)
    share = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return float(np.linalg.norm(point - a - share * (b - a)))


ROOM = closed((-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0))
WITH_A_BAY = closed(
    (-3.0, -4.0),
    (3.0, -4.0),
    (3.0, -2.0),
    (4.0, -1.0),
    (4.0, 1.0),
    (3.0, 2.0),
    (3.0, 4.0),
    (-3.0, 4.0),
)
WITH_A_SHELF = [*ROOM, *closed((2.6, -1.0), (3.0, -1.0), (3.0, 1.0), (2.6, 1.0))]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    ("segments", "walls"),
    [(ROOM, 4), (WITH_A_BAY, 7), (WITH_A_SHELF, 5)],
    ids=["room", "bay", "shelf"],
)
def test_the_map_contains_the_true_walls_and_no_others(
    segments: list[Segment], walls: int, seed: int
) -> None:
    path = [(0.0, 0.0), (1.0, -2.0), (1.0, 2.0), (-1.0, 1.0), (0.0, 0.0)]
    record = fly(segments, path, seed)
    estimate = mapped(record)
    errors_m = wall_errors_m(walls_of(estimate, record), segments)
    assert errors_m.mean() < 0.04
    assert errors_m.max() < 0.5
    assert len(estimate.x.walls) >= walls
    assert (estimate.wall_of != NO_WALL).mean() > 0.75


def test_walls_of_two_rooms_that_are_nearly_in_line_stay_separate() -> None:
    """Walls 0.4 m out of line, with a passage of 2 m between the rooms."""
    upper = [((1.0, -3.0), (1.0, 3.0)), ((1.0, 3.0), (7.0, 3.0)), ((1.0, -3.0), (7.0, -3.0))]
    lower = [((-1.0, -3.0), (-1.0, 3.4)), ((-1.0, 3.4), (-7.0, 3.4)), ((-1.0, -3.0), (-7.0, -3.0))]
    opened = [((1.0, -3.0), (1.0, -0.6)), ((1.0, 0.6), (1.0, 3.0))]
    opened += [((-1.0, -3.0), (-1.0, -0.6)), ((-1.0, 0.6), (-1.0, 3.4))]
    segments = [*upper[1:], *lower[1:], *opened]
    path = [(4.0, 0.0), (2.5, 0.0), (0.0, 0.0), (-2.5, 0.0), (-4.0, 0.5), (-4.5, 0.0)]
    estimate = mapped(fly(segments, path, 1))
    east = sorted(
        offset_m
        for normal_rad, offset_m in estimate.x.walls
        if abs(normal_rad - math.pi / 2) < math.radians(5)
    )
    assert [round(offset_m, 1) for offset_m in east] == [3.0, 3.4]


def test_ranges_to_people_form_no_walls_and_do_not_shift_the_trajectory() -> None:
    """A fifth of all ranges end early, at a random distance."""
    record, random = fly(ROOM, [(0.0, 0.0), (1.0, -1.5), (1.0, 1.5), (0.0, 0.0)], 4), Random(4)
    for row in record.hits:
        if random.random() < 0.2:
            row[6] = random.uniform(1.0, max(row[6], 1.1))
    estimate = mapped(record)
    assert len(estimate.x.walls) == 4
    assert wall_errors_m(walls_of(estimate, record), ROOM).max() < 0.1
    assert np.abs(estimate.x.poses[:, :2] - record.poses[:, :2]).max() < 0.1


@pytest.mark.parametrize(("hits", "are_on_wall"), [(1, False), (3, False), (12, True)])
def test_a_hit_is_associated_with_a_wall_only_if_it_has_enough_neighbours(
    hits: int, are_on_wall: bool
) -> None:
    record = fly([((3.0, -3.0), (3.0, 3.0))], [(0.0, -2.0), (0.0, 2.0)], seed=1)
    for i in range(-100, hits):
        pose = Pose(60.0 + 0.05 * i, 0.0, 2.0, -1.2, math.tau)
        record.advance(pose, (0.0, 2.0), math.tau)
        if i < 0:
            continue
        record.add_hit(pose, BEAMS.index(Beam.FRONT), 3.02, ((0.0, 0.0), 0.0), None)
    wall_of = mapped(record).wall_of
    assert (wall_of[:-hits] != NO_WALL).mean() > 0.9
    assert (wall_of[-hits:] != NO_WALL).all() == are_on_wall


CUPBOARD = closed((2.4, -1.9), (3.0, -1.9), (3.0, 1.9), (2.4, 1.9))


@pytest.mark.parametrize(
    ("between_m", "obstacle", "one"), [(4.0, [], False), (4.0, CUPBOARD, True), (1.0, [], True)]
)
def test_distant_pieces_are_one_wall_only_if_an_obstacle_hides_the_gap(
    between_m: float, obstacle: list[Segment], one: bool
) -> None:
    """A line fits any two short pieces, even without a wall between them."""
    end = 0.5 * between_m
    pieces = [((3.0, -end - 1.0), (3.0, -end)), ((3.0, end), (3.0, end + 1.0))]
    record = fly([*pieces, *obstacle], [(0.0, -end - 1.2), (0.0, end + 1.2)], seed=2)
    x, m = Unknowns.at(record.poses.copy(), 0.0), Measured.of(record, UNITS)
    x.add_walls(np.array([[0.0, 3.0]]), np.array([[-end - 1.0, end + 1.0]]))
    wall_of = Association(UNITS, OdometryModel(), Support()).associate(x, m, FINAL_GATES[0])
    east_m = project(x, m).points[:, 1]
    is_on_wall = wall_of != NO_WALL
    on_both = is_on_wall[east_m < -end].any() and is_on_wall[east_m > end].any()
    assert on_both == one


def cluster(pieces: int, radius_m: float, size_m: float, seed: int) -> list[Segment]:
    """Sides of square posts within a circle in a corner of `ROOM`."""
    random, sides = Random(seed), list[Segment]()
    for _ in range(pieces):
        angle_rad, away_m = random.uniform(0, math.tau), radius_m * math.sqrt(random.random())
        north, east = 1.4 + away_m * math.cos(angle_rad), 1.0 + away_m * math.sin(angle_rad)
        far_north, far_east = north + size_m, east + size_m
        sides += closed((north, east), (far_north, east), (far_north, far_east), (north, far_east))
    return sides


@pytest.mark.parametrize(
    "furniture", [cluster(20, 0.7, 0.08, 3), cluster(12, 0.5, 0.12, 1), cluster(12, 0.5, 0.12, 2)]
)
def test_the_map_has_no_walls_across_a_cluster_of_furniture(furniture: list[Segment]) -> None:
    path = [(-1.0, -2.0), (0.0, 0.0), (-1.0, 1.0), (1.8, -2.0), (-0.5, -0.5), (-1.5, 2.0)]
    path += [(0.2, 2.4), (-1.5, 2.0), (0.0, -0.8), (2.4, -0.8), (0.0, -0.8), (-1.0, 0.0)]
    record = fly([*ROOM, *furniture], path, 1)
    errors_m = wall_errors_m(walls_of(mapped(record), record), [*ROOM, *furniture])
    assert errors_m.max() < 0.2
