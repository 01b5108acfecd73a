"""The scores, on maps whose error is known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.frames import Vector2, frd_to_ned
from companion.messages import FloorPlan, Pose, WallSegment
from sitl.score import clear_in_the_open_m, least_time_s, score_map, score_trajectory
from sitl.truth import TrueState
from sitl.world.plan import samples

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


def test_the_true_map_is_perfect() -> None:
    score = score_map(mapped(ROOM), ROOM, samples(ROOM), HERE)
    assert score.wall_error_cm == pytest.approx(0, abs=1e-9)
    assert (score.coverage, score.false_walls) == (1.0, 0.0)


@settings(max_examples=20)
@given(st.floats(-0.15, 0.15), st.floats(-0.15, 0.15), st.floats(-0.02, 0.02))
def test_alignment_takes_out_a_rigid_error(north: float, east: float, turn_rad: float) -> None:
    walls = [(moved(a, north, east, turn_rad), moved(b, north, east, turn_rad)) for a, b in ROOM]
    score = score_map(mapped(walls), ROOM, samples(ROOM), HERE)
    assert score.wall_error_aligned_cm < 0.1
    assert score.coverage == 1.0


def test_the_take_off_pose_puts_the_map_into_the_world() -> None:
    take_off = TrueState(0.0, (3.0, 4.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 1.0, 0.0)
    there = [tuple(frd_to_ned(p[0] - 3.0, p[1] - 4.0, -1.0) for p in wall) for wall in ROOM]
    score = score_map(mapped(there), ROOM, samples(ROOM), take_off)  # type: ignore[arg-type]
    assert score.wall_error_cm == pytest.approx(0, abs=1e-6)


def test_a_map_too_large_cannot_be_aligned_away() -> None:
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


def test_trajectory_error_by_evo() -> None:
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
        ((0.0, 5.0), math.inf),  # in the doorway, 0.9 m wide
        ((0.5, 5.0), 0.4727),  # through it: the jambs are behind, and not opposite
    ],
)
def test_clearance_counts_where_there_is_room_to_keep_it(place: Vector2, clear_m: float) -> None:
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
