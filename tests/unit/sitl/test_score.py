"""Tests of the scores on maps with known errors."""

import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.arrays import Array
from companion.core.frames import Vector2, frd_to_ned
from companion.core.messages import FloorPlan, Pose, WallSegment
from sitl.core.truth import TrueState
from sitl.scoring.score import clear_in_the_open_m, least_time_s, score_map, score_trajectory
from sitl.world.geometry.nearest import NearestWall
from sitl.world.plan import samples
from tests.examples import examples

ROOM: list[tuple[Vector2, Vector2]] = [
    ((0.0, 0.0), (10.0, 0.0)),
    ((10.0, 0.0), (10.0, 10.0)),
    ((10.0, 10.0), (0.0, 10.0)),
    ((0.0, 10.0), (0.0, 0.0)),
]
HERE = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)


def mapped(walls: list[tuple[Vector2, Vector2]]) -> FloorPlan:
    return FloorPlan(tuple(WallSegment(start, end, 0.01, 10) for start, end in walls))


def moved(point: Vector2, north: float, east: float, turn_rad: float) -> Vector2:
    n, e = frd_to_ned(*point, turn_rad)
    return n + north, e + east


def test_the_true_map_has_a_perfect_score() -> None:
    score = score_map(mapped(ROOM), ROOM, samples(ROOM), HERE)
    assert score.wall_error_cm == pytest.approx(0, abs=1e-9)
    assert (score.coverage, score.false_walls) == (1.0, 0.0)


@settings(max_examples=examples(20))
@given(st.floats(-0.15, 0.15), st.floats(-0.15, 0.15), st.floats(-0.02, 0.02))
def test_alignment_removes_a_rigid_error(north: float, east: float, turn_rad: float) -> None:
    walls = [(moved(a, north, east, turn_rad), moved(b, north, east, turn_rad)) for a, b in ROOM]
    score = score_map(mapped(walls), ROOM, samples(ROOM), HERE)
    assert score.wall_error_aligned_cm < 0.1
    assert score.coverage == 1.0


def test_the_take_off_pose_transforms_the_map_into_the_world_frame() -> None:
    take_off = TrueState(0.0, (3.0, 4.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 1.0, 0.0)
    there = [tuple(frd_to_ned(p[0] - 3.0, p[1] - 4.0, -1.0) for p in wall) for wall in ROOM]
    score = score_map(mapped(there), ROOM, samples(ROOM), take_off)  # type: ignore[arg-type]
    assert score.wall_error_cm == pytest.approx(0, abs=1e-6)


def test_alignment_does_not_remove_a_scale_error() -> None:
    walls = [((1.02 * a[0], 1.02 * a[1]), (1.02 * b[0], 1.02 * b[1])) for a, b in ROOM]
    score = score_map(mapped(walls), ROOM, samples(ROOM), HERE)
    assert score.wall_error_aligned_cm == pytest.approx(10, abs=2)


def test_missing_and_invented_walls_are_counted() -> None:
    invented: tuple[Vector2, Vector2] = ((3.0, 3.0), (3.0, 8.0))
    score = score_map(mapped([*ROOM[:3], invented]), ROOM, samples(ROOM), HERE)
    assert score.coverage == pytest.approx(0.75, abs=0.01)
    assert score.false_walls == pytest.approx(5 / 35, abs=0.01)


def test_an_empty_map_covers_nothing() -> None:
    assert score_map(FloorPlan(), ROOM, samples(ROOM), HERE).coverage == 0.0


def test_the_trajectory_error_equals_the_known_offset() -> None:
    truth = [
        TrueState(0.1 * i, (math.cos(i / 9), math.sin(i / 9), 0.0), (0, 0, 0), 0, 0, 0, 0)
        for i in range(50)
    ]
    take_off = TrueState(0.0, (0.0, 0.0, 0.0), (0, 0, 0), 0, 0, 0.0, 0)
    path = [Pose(s.time_s, s.position_ned_m[0] + 0.1, s.position_ned_m[1], 0.0, 0.0) for s in truth]
    score = score_trajectory(path, truth, take_off)
    assert score.ate_take_off_frame_cm == pytest.approx(10)
    assert score.ate_cm == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(("standoff_m", "least_s"), [(1.0, 32), (1.5, 28), (2.0, 24)])
def test_least_time_of_the_papers_room(standoff_m: float, least_s: float) -> None:
    assert least_time_s(ROOM, standoff_m, 1.0) == least_s


@pytest.mark.parametrize(
    ("place", "clear_m"),
    [
        ((0.0, 1.0), 0.8),  # before a wall
        ((0.0, 5.0), math.inf),  # in the doorway of 0.9 m
        ((0.5, 5.0), 0.4727),  # past the doorway: both jambs are behind, not on opposite sides
    ],
)
def test_clearance_in_the_open_ignores_narrow_passages(place: Vector2, clear_m: float) -> None:
    doorway: list[tuple[Vector2, Vector2]] = [
        ((-5.0, 0.0), (5.0, 0.0)),
        ((0.0, 5.45), (0.0, 9.0)),
        ((0.0, 2.0), (0.0, 4.55)),
    ]
    away = [(-2.0, 2.0), place]
    far = clear_in_the_open_m(doorway, np.array(away[:1]), 0.2)
    assert far == pytest.approx(1.8)
    least_m = clear_in_the_open_m(doorway, np.array(away[1:]), 0.2)
    assert least_m == pytest.approx(clear_m, abs=1e-3)
    assert clear_in_the_open_m(doorway, np.array(away), 0.2) == min(far, least_m)
    assert clear_in_the_open_m([], np.array(away), 0.2) == math.inf


def nearest_by_brute_force(points: Array, walls: Array) -> tuple[Array, Array]:
    """Distance and closest point on any wall, from a table of all pairs."""
    start, along = walls[:, 0], walls[:, 1] - walls[:, 0]
    share = ((points[:, None] - start) * along).sum(axis=2) / (along**2).sum(axis=1)
    feet = start + np.clip(share, 0, 1)[..., None] * along
    away = np.linalg.norm(points[:, None] - feet, axis=2)
    best = away.argmin(axis=1)
    rows = np.arange(len(points))
    return away[rows, best], feet[rows, best]


@settings(max_examples=examples(50))
@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.floats(0.02, 8))
def test_the_nearest_wall_matches_a_brute_force_search(
    seed: int, count: int, longest_m: float
) -> None:
    random = np.random.default_rng(seed)
    starts = random.uniform(0, 10, (count, 2))
    bearing = random.uniform(0, math.tau, count)
    along = np.column_stack([np.cos(bearing), np.sin(bearing)])
    lengths_m = random.uniform(0.01, longest_m, (count, 1))
    walls = np.stack([starts, starts + lengths_m * along], axis=1)
    points = np.concatenate([random.uniform(-3, 13, (60, 2)), starts, walls.mean(axis=1)])
    distance, foot = NearestWall(walls).query(points)
    expected_m, at = nearest_by_brute_force(points, walls)
    assert np.array_equal(distance, expected_m)
    assert np.array_equal(foot, at)


def test_many_equally_near_walls_give_the_correct_distance() -> None:
    """All rays of a star are equally near to its centre; the first query returns only some."""
    bearing = np.arange(40) * math.tau / 40
    ray = np.column_stack([np.cos(bearing), np.sin(bearing)])
    walls = np.stack([ray, 5 * ray], axis=1)
    distance, _ = NearestWall(walls).query(np.zeros((1, 2)))
    assert distance == pytest.approx([1.0])


def test_thousands_of_walls_are_scored_without_a_table_of_all_pairs() -> None:
    """The table for 40 000 samples and 4000 walls would take a gigabyte per alignment step."""
    walls = [
        ((north, east), (north + 0.5, east))
        for north in np.arange(0.0, 40.0)
        for east in np.arange(0.0, 100.0)
    ]
    tracemalloc.start()
    score = score_map(mapped(walls), walls, samples(walls), HERE)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert score.coverage == 1.0
    assert score.wall_error_cm == pytest.approx(0, abs=1e-9)
    assert peak_bytes < 150e6
