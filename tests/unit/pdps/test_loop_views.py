"""Tests the viewpoints that measure uncertain walls again."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.known_walls import KnownWalls
from companion.core.messages import Beam, Pose, RangeReading, RangeState
from companion.estimation.filters.heading_filter import HeadingFilter, WallBearing
from companion.estimation.filters.position_filter import WALLS, LineSlam, Wall
from companion.estimation.smoothing.odometry_model import OdometryModel
from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray
from companion.navigation.grid_planner import ShortestPaths, find_ground, find_ways
from companion.navigation.observation import Claim, Observation
from companion.pdps.explore import Explore, ExplorePhase, step
from companion.pdps.loop_views import (
    AGAIN_WITHIN_M,
    LOOSE_M,
    TIES_FROM_M,
    TIES_TO_M,
    TRIED_WITHIN_M,
    VAGUE_M,
    again,
    ties,
)
from companion.pdps.viewpoints import Viewpoint, looks
from companion.pdps.visibility import is_clear

PLAN = MissionConfig(kind="building")
HALF_M, REACH_M = 3.5, 5.0
NEVER = np.full(2, -np.inf)
"""Distance of the two walls north and south of the middle, m; they are 10 m long."""
HERE: Vector2 = (0.0, -2.0)


def two_walls(sigma_m: float, *, tied: bool = False, turned_rad: float = 0.0) -> KnownWalls:
    """Two walls with this sigma to the origin. `tied`: the distance between them is exact."""
    normals = np.array([[math.cos(turned_rad), math.sin(turned_rad)]]) * [[1.0], [-1.0]]
    covariance_m2 = sigma_m**2 * np.array([[1.0, -1.0], [-1.0, 1.0]] if tied else np.eye(2))
    reach_m = np.array([[-REACH_M, REACH_M]] * 2)
    return KnownWalls(normals, np.array([HALF_M, HALF_M]), reach_m, covariance_m2, NEVER)


@cache
def yard(*, partition: bool = False) -> Occupancy:
    """The space between the walls, fully seen."""
    grid = Occupancy()
    for decimetre in range(-45, 46):
        for bearing_rad in (0.0, math.pi):
            for _ in range(3):
                eye = (0.05, 0.1 * decimetre + 0.05)
                grid.add(Ray(eye, bearing_rad, HALF_M, 0.01, is_hit=True, time_s=0.0))
    if partition:
        for decimetre in range(-45, 46):
            grid.block((0.05, 0.1 * decimetre + 0.05), 0.01)
    return grid


def sealed() -> Occupancy:
    """The yard with walls at its east and west ends."""
    grid = yard().copy()
    for north_m in np.arange(-HALF_M, HALF_M + 0.1, 0.1).tolist():
        for east_m in (-4.6, 4.7):
            grid.block((north_m, east_m), 0.1)
    return grid


def observation(walls: KnownWalls, here: Vector2 = HERE, *claims: Claim) -> Observation:
    clear = RangeReading(RangeState.DISTANCE, 5.0, 0.01)
    pose = Pose(10.0, *here, -PLAN.height_m, 0.0)
    return Observation(pose, {Beam.FRONT: clear}, 0.0, walls=lambda: walls, claims=claims)


def claim(places: tuple[Vector2, ...], *, is_extra: bool) -> Claim:
    """What a teammate that is there now looks at."""
    return Claim(places, 0.0, is_extra, comes_first=True, from_ne_m=places[0])


@cache
def ways_from(grid: Occupancy, here: Vector2) -> ShortestPaths:
    return find_ways(find_ground(grid, here, 0.5))


def found(
    walls: KnownWalls,
    grid: Occupancy,
    tried: tuple[Viewpoint, ...] = (),
    here: Vector2 = HERE,
    *,
    plan: MissionConfig = PLAN,
    search: Callable[..., tuple[Viewpoint, ...]] = ties,
    claims: tuple[Claim, ...] = (),
) -> tuple[Viewpoint, ...]:
    return search(ways_from(grid, here), observation(walls, here, *claims), plan, tried)


found_again = partial(found, search=again)


@given(st.floats(1.1 * LOOSE_M, 1.0))
def test_walls_with_an_uncertain_distance_get_a_viewpoint_near_both(sigma_m: float) -> None:
    look = found(two_walls(sigma_m), yard())[0]
    assert sorted(north_m for north_m, _ in look.at_ne_m) == pytest.approx([-HALF_M, HALF_M])
    for foot in look.at_ne_m:
        assert TIES_FROM_M <= math.dist(look.from_ne_m, foot) <= TIES_TO_M


@given(st.floats(0.0, 1.0))
def test_walls_with_a_well_known_distance_between_them_get_no_viewpoint(sigma_m: float) -> None:
    assert not found(two_walls(sigma_m, tied=True), yard())
    assert not found(two_walls(0.5 * LOOSE_M), yard())


def test_a_partition_between_two_walls_prevents_a_viewpoint() -> None:
    walls, grid = two_walls(0.2), yard(partition=True)
    assert not found(walls, grid, here=(1.5, -2.0))


@pytest.mark.parametrize(
    ("search", "within_m", "times"),
    [(ties, TRIED_WITHIN_M, (2, 8)), (again, AGAIN_WITHIN_M, (1, 3))],
)
def test_a_viewpoint_is_not_tried_twice_from_one_place(
    search: Callable[..., tuple[Viewpoint, ...]], within_m: float, times: tuple[int, int]
) -> None:
    walls, grid = two_walls(0.2), yard()
    tried: tuple[Viewpoint, ...] = ()
    while more := found(walls, grid, tried, search=search):
        for look in tried:
            assert math.dist(look.from_ne_m, more[0].from_ne_m) > within_m
        tried = (*tried, *more)
    least, most = times
    assert least <= len(tried) <= most


@given(st.floats(1.1 * VAGUE_M, 1.0), st.floats(0.0, 0.9))
def test_the_wall_with_the_largest_sigma_is_measured_again(sigma_m: float, share: float) -> None:
    known = two_walls(sigma_m)
    covariance_m2 = sigma_m**2 * np.diag([share, 1.0])
    look = found_again(replace(known, covariance_m2=covariance_m2), yard())[0]
    assert look.is_extra
    (foot,) = look.at_ne_m
    assert foot[0] == pytest.approx(-HALF_M)
    assert TIES_FROM_M <= math.dist(look.from_ne_m, foot) <= TIES_TO_M


@given(st.floats(0.0, VAGUE_M))
def test_walls_with_a_small_sigma_are_not_measured_again(sigma_m: float) -> None:
    assert not found_again(two_walls(sigma_m), yard())


def test_the_layers_mission_does_not_measure_walls_again() -> None:
    assert not found_again(two_walls(0.2), yard(), plan=MissionConfig(kind="layers"))


def test_of_two_uncertain_walls_the_visible_one_is_measured_again() -> None:
    known, grid = two_walls(0.2), yard(partition=True)
    covariance_m2 = np.diag([0.2**2, 0.3**2])
    look = found_again(replace(known, covariance_m2=covariance_m2), grid, here=(1.5, -2.0))[0]
    assert look.at_ne_m[0][0] == pytest.approx(HALF_M)


def test_uncertain_walls_are_measured_after_the_last_frontier_before_the_mission_ends() -> None:
    """A closed corridor, so that the walls' distance is the only target."""
    grid, walls, tied = sealed(), two_walls(0.2), two_walls(0.5 * VAGUE_M, tied=True)
    enough = tuple(Viewpoint(HERE, _everywhere()) for _ in range(3))
    explore = Explore(ExplorePhase.CHOOSE, tried=enough)
    while explore.phase is ExplorePhase.CHOOSE:
        explore, _ = step(explore, observation(walls), grid, PLAN)
    assert explore.phase is ExplorePhase.GO
    assert explore.is_extra
    assert explore.look is not None
    there = explore.look.from_ne_m
    while explore.phase is ExplorePhase.GO:
        explore, _ = step(explore, observation(walls, there), grid, PLAN)
    assert explore.phase is ExplorePhase.LOOK
    assert explore.to_turn_rad > math.pi
    explore = replace(explore, to_turn_rad=0.0)
    while explore.phase is not ExplorePhase.DONE:
        explore, _ = step(explore, observation(tied, there), grid, PLAN)


@given(st.floats(-3.0, 3.0))
def test_walls_that_a_teammate_measures_again_are_left_to_it(east_m: float) -> None:
    walls = two_walls(0.2)
    both = claim(((HALF_M, east_m), (-HALF_M, east_m)), is_extra=True)
    assert not found(walls, yard(), claims=(both,))
    assert not found_again(walls, yard(), claims=(both,))
    one = claim(((HALF_M, east_m),), is_extra=True)
    assert found(walls, yard(), claims=(one,))
    (other,) = found_again(walls, yard(), claims=(one,))
    assert other.at_ne_m[0][0] == pytest.approx(-HALF_M)
    unseen = claim(((HALF_M, east_m), (-HALF_M, east_m)), is_extra=False)
    assert found(walls, yard(), claims=(unseen,))


def test_a_drone_measures_walls_again_while_teammates_look_at_all_that_is_unseen() -> None:
    grid, walls = yard(), two_walls(0.2)
    left = looks(ways_from(grid, HERE), observation(walls), PLAN)
    claims = [claim(look.at_ne_m, is_extra=False) for look in left]
    explore = Explore(ExplorePhase.CHOOSE)
    while explore.phase is ExplorePhase.CHOOSE:
        explore, _ = step(explore, observation(walls, HERE, *claims), grid, PLAN)
    assert explore.look is not None
    assert explore.look.is_tie


def _everywhere() -> tuple[Vector2, ...]:
    return tuple((0.25 * i, 0.25 * j) for i in range(-20, 21) for j in range(-24, 25))


@given(st.floats(-math.pi, math.pi), st.floats(0.0, 0.3), st.booleans())
def test_sigma_of_a_distance_is_independent_of_north(
    turned_rad: float, sigma_m: float, tied: bool
) -> None:
    sigmas_m = two_walls(sigma_m, tied=tied, turned_rad=turned_rad).gap_sigmas_m()
    expected_m = 0.0 if tied else math.sqrt(2) * sigma_m
    assert sigmas_m[0, 1] == pytest.approx(expected_m, abs=1e-6)
    assert not np.diag(sigmas_m).any()


@given(st.floats(-REACH_M, REACH_M), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi))
def test_the_perpendicular_from_a_place_meets_the_wall_at_its_foot(
    east_m: float, north_m: float, turned_rad: float
) -> None:
    walls, place = two_walls(0.1, turned_rad=turned_rad), (north_m, east_m)
    for wall, away_m in enumerate(walls.distances_m(np.array([place]))[0].tolist()):
        foot = walls.foot_ne_m(wall, place)
        assert math.dist(place, foot) == pytest.approx(abs(away_m), abs=1e-9)
        assert np.dot(foot, walls.normals[wall]) == pytest.approx(HALF_M)


def test_the_filter_estimates_the_sigma_of_a_distance() -> None:
    """Sigma between two walls, measured with a flight between, or from one place."""
    slam = LineSlam(heading := HeadingFilter(0.0), OdometryModel())
    for side in (0.0, math.pi):
        heading.add_wall(WallBearing(side, math.radians(0.5), 0.0, 0.0))
    walls = [Wall(0, (3.0, 0.0), -3.0, 3.0), Wall(1, (-3.0, 0.0), -3.0, 3.0)]
    size = WALLS + len(walls)
    state = np.zeros(size)
    apart, at_once = np.diag(np.full(size, 0.1)) ** 2, np.zeros((size, size))
    by_position = np.zeros(size)
    by_position[[0, WALLS, WALLS + 1]] = 1.0, 1.0, -1.0
    at_once += 0.1**2 * np.outer(by_position, by_position)
    for covariance, sigma_m in ((apart, 0.141), (at_once, 0.0)):
        slam.restart(state, covariance, walls)
        known = KnownWalls(
            np.array([[1.0, 0.0], [-1.0, 0.0]]),
            np.array([3.0, 3.0]),
            np.array([[-3.0, 3.0]] * 2),
            slam.offsets_covariance_m2,
            NEVER,
        )
        assert known.gap_sigmas_m()[0, 1] == pytest.approx(sigma_m, abs=0.01)


@given(st.integers(-300, 300), st.integers(-300, 300))
def test_lines_outside_the_grid_are_clear(row: int, column: int) -> None:
    """A wall that was just corrected may lie outside the grid."""
    start, end = np.array([[0, 0]]), np.array([[row, column]])
    assert is_clear(Occupancy(), start, end, 40.0).all()


@pytest.mark.parametrize("search", [ties, again])
@pytest.mark.parametrize(("wander_m", "goes_through"), [(0.002, True), (0.07, False)])
@pytest.mark.parametrize("yard_of", [sealed, yard])
def test_extra_viewpoints_are_not_beyond_a_passage_too_narrow_for_the_drift(
    search: Callable[..., tuple[Viewpoint, ...]],
    wander_m: float,
    goes_through: bool,
    yard_of: Callable[[], Occupancy],
) -> None:
    """A doorway of 1 m divides the yard; its ends are closed, or unknown space lies beyond."""
    grid = yard_of().copy()
    for decimetre in range(-35, 36):
        if abs(0.1 * decimetre + 0.05) > 0.5:
            grid.block((0.1 * decimetre + 0.05, 0.5), 0.01)
    ways = find_ways(find_ground(grid, HERE, 0.5))
    seen = replace(observation(two_walls(0.2)), wander_m=wander_m)
    tried: tuple[Viewpoint, ...] = ()
    while more := search(ways, seen, PLAN, tried):
        tried = (*tried, *more)
    assert tried
    assert any(look.from_ne_m[1] > 0.6 for look in tried) == goes_through
