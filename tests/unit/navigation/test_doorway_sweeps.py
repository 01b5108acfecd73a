"""Doorways are measured by a sweep over both jambs, and passed in the middle."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray
from companion.navigation import sweep as sweeping
from companion.navigation import travel as travelling
from companion.navigation.doorways import Doorway
from companion.navigation.path_follower import (
    ARRIVED_M,
)
from companion.navigation.sweep import over_jambs
from companion.navigation.travel_state import Travel, TravelPhase, onward
from tests.grids import (
    PLAN,
    Place,
    observation,
    open_ground,
    remaining_headings_rad,
    step_travel,
    with_doorway,
)


def test_a_path_crosses_a_doorway_perpendicularly_in_its_middle() -> None:
    travel, _ = step_travel(Travel((3.0, 1.5)), with_doorway(1.45))
    before, after = travel.way[:2]
    assert before[0] < 1.45 < after[0]
    for _, east_m in (before, after):
        assert east_m == pytest.approx(0.0, abs=0.1)


def test_a_wall_on_one_side_is_no_doorway() -> None:
    grid = open_ground()
    for row in range(-40, 41):
        grid.block((0.1 * row + 0.05, -0.6), 0.01)
    travel, _ = step_travel(Travel((3.0, 0.0)), grid)
    assert travel.doorways == ()


def test_the_drone_sweeps_both_jambs_before_a_doorway_and_then_continues() -> None:
    grid = with_doorway(1.45)
    travel, setpoint = step_travel(Travel((3.0, 0.0)), grid)
    assert travel.phase is TravelPhase.SWEEP
    assert setpoint.forward_m_s == 0
    swept_rad = []
    while travel.phase is TravelPhase.SWEEP:
        swept_rad.append(remaining_headings_rad(travel)[0])
        seen = observation(yaw_rad=swept_rad[-1])
        travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert min(swept_rad) < -0.5 < 0.5 < max(swept_rad)
    travel, setpoint = step_travel(travel, grid)
    assert travel.phase is TravelPhase.FLY
    assert setpoint.forward_m_s > 0


def swept_again_if_narrow(travel: Travel, grid: Occupancy, width_m: float) -> tuple[Travel, float]:
    """Sweep the opening, twice if it seems narrow; return the travel and the time."""
    travel, time_s = swept(travel, grid, width_m)
    if travel.known[0].looks_narrow:
        travel, time_s = swept(travel, grid, width_m, time_s=time_s + 0.05)
    return travel, time_s


def swept(
    travel: Travel,
    grid: Occupancy,
    width_m: float,
    place: Place = (0.0, 0.0),
    time_s: float = 10.0,
) -> tuple[Travel, float]:
    """The travel after a sweep of both jambs, 1.45 m north, and the time."""
    heading = 1.0 if place[0] < 1.45 else -1.0
    seen = observation(place, math.acos(heading), time_s=time_s)
    travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert travel.phase is TravelPhase.SWEEP
    yaw_rad = remaining_headings_rad(travel)[0]
    while travel.phase is TravelPhase.SWEEP:
        time_s += 0.05
        east_m = place[1] + (1.45 - place[0]) * math.tan(yaw_rad)
        away_m = math.dist(place, (1.45, east_m)) if abs(east_m) > 0.5 * width_m else 5.0
        seen = observation(place, yaw_rad, away_m, time_s)
        travel, setpoint = travelling.step(travel, seen, grid, PLAN)
        yaw_rad += 0.05 * setpoint.yaw_rate_rad_s
    return travel, time_s


@pytest.mark.parametrize(("width_m", "enters"), [(0.7, False), (0.74, False), (0.9, True)])
def test_an_opening_measured_narrower_than_a_door_is_not_entered(
    width_m: float, *, enters: bool
) -> None:
    """All openings are free cells. A reading every 3 cm, without noise, measures 1 to 6 cm more."""
    grid = with_doorway(1.45)
    travel, time_s = swept_again_if_narrow(Travel((3.0, 0.0)), grid, width_m)
    travel, _ = step_travel(travel, grid, time_s=time_s + 0.05)
    assert travel.phase is (TravelPhase.FLY if enters else TravelPhase.GAVE_UP)
    later = onward(travel, (3.0, 0.5), ARRIVED_M)
    later = replace(later, known=tuple(replace(d, swept_s=-math.inf) for d in later.known))
    later, _ = step_travel(later, grid, time_s=time_s + 60.0)
    assert bool(later.doorways) is enters


def test_a_doorway_measured_too_narrow_once_is_swept_again_and_entered() -> None:
    grid = with_doorway(1.45)
    travel, time_s = swept(Travel((3.0, 0.0)), grid, 0.7)
    travel, time_s = swept(travel, grid, 0.9, time_s=time_s + 0.05)
    travel, _ = step_travel(travel, grid, time_s=time_s + 0.05)
    assert travel.phase is TravelPhase.FLY
    assert travel.doorways


def test_a_pose_correction_during_a_sweep_does_not_narrow_the_doorway() -> None:
    detected = ((1.45, 0.45), (1.45, 0.5))
    seen = observation()
    doorway = Doorway(0, (1.45, 0.0), (1.0, 0.0), 0.45)
    sweep = replace(over_jambs(doorway, seen), met_ne_m=detected)
    moved = replace(seen, pose=replace(seen.pose, east_m=-0.3, reset_counter=1))
    sweep, _ = sweeping.step(sweep, moved, PLAN)
    assert np.array(sweep.met_ne_m) == pytest.approx(np.array([(1.45, 0.15), (1.45, 0.2)]))


def test_the_path_home_leads_through_any_opening_wide_enough_for_the_drone() -> None:
    grid = with_doorway(1.45)
    travel, time_s = swept(Travel((0.0, 0.0)), grid, 0.75, (2.9, 0.0))
    seen = observation((2.9, 0.0), math.pi, time_s=time_s + 0.05)
    travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert travel.phase is TravelPhase.FLY
    assert travel.way[-1] == (0.0, 0.0)


def test_an_opening_already_flown_through_is_entered_again_although_it_is_narrow() -> None:
    grid = with_doorway(1.45)
    for decimetre in range(26):
        grid.add(Ray((0.1 * decimetre, 0.0), 0.0, 0.5, 0.01, is_hit=False, time_s=0.0))
    travel, time_s = swept_again_if_narrow(Travel((3.0, 0.0)), grid, 0.75)
    travel, _ = step_travel(travel, grid, time_s=time_s + 0.05)
    assert travel.phase is TravelPhase.FLY


def test_the_drone_backs_off_if_it_is_too_near_to_measure_the_jambs() -> None:
    travel, _ = step_travel(Travel((3.0, 0.0)), with_doorway(0.85))
    assert travel.phase is TravelPhase.FLY
    assert travel.way[0][0] < -0.2


def test_the_drone_does_not_back_off_where_it_has_no_room_to_turn() -> None:
    grid = with_doorway(0.85)
    for row, side in product(range(-40, 8), (-1, 1)):
        grid.block((0.1 * row + 0.05, side * 0.65), 0.01)
    travel, _ = step_travel(Travel((3.0, 0.0)), grid)
    assert travel.phase is TravelPhase.FLY
    assert min(corner[0] for corner in travel.way) > 0


def test_a_pose_correction_during_a_sweep_does_not_move_the_drone() -> None:
    grid = with_doorway(1.45)
    travel, _ = step_travel(Travel((3.0, 0.0)), grid)
    seen = observation((0.0, 0.3))
    stepped = replace(seen, pose=replace(seen.pose, reset_counter=1))
    travel, setpoint = travelling.step(travel, stepped, grid, PLAN)
    assert (setpoint.forward_m_s, setpoint.right_m_s) == (0.0, 0.0)


def test_in_a_corridor_the_drone_moves_aside_to_sweep_the_jambs() -> None:
    grid = with_doorway(0.65)
    for row in range(-40, 41):
        grid.block((-1.0, 0.1 * row + 0.05), 0.01)
    travel, _ = step_travel(Travel((3.0, 0.0)), grid)
    aside = travel.way[0]
    assert travel.phase is TravelPhase.FLY
    assert abs(aside[1]) > 0.8
    travel, _ = travelling.step(travel, observation(aside), grid, PLAN)
    assert travel.phase is TravelPhase.SWEEP


def test_a_recently_swept_doorway_is_not_swept_again() -> None:
    for swept_s, phase in ((5.0, TravelPhase.FLY), (-50.0, TravelPhase.SWEEP)):
        doorway = Doorway(0, (1.45, 0.0), (1.0, 0.0), 0.5, swept_s)
        travel, _ = step_travel(Travel((3.0, 0.0), known=(doorway,)), with_doorway(1.45))
        assert travel.phase is phase


@pytest.mark.parametrize("through", [1.0, -1.0])
def test_a_known_doorway_is_swept_although_its_jambs_are_not_in_the_map(through: float) -> None:
    doorway = Doorway(3, (1.45, 0.1), (through, 0.0), 0.5)
    travel, _ = step_travel(Travel((3.0, 0.0), known=(doorway,)), open_ground())
    assert travel.phase is TravelPhase.SWEEP
    aside = replace(doorway, middle_ne_m=(1.45, 1.0))
    travel, _ = step_travel(Travel((3.0, 0.0), known=(aside,)), open_ground())
    assert travel.phase is TravelPhase.FLY
