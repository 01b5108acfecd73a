"""Tests that the drone turns back in time, and descends over its start or on free floor nearby."""

import math
from dataclasses import replace

import pytest

from companion.core.messages import Beam, Pose, RangeReading, RangeScan, RangeState
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray
from companion.navigation.energy_reserve import Reserve, Spent
from companion.navigation.observation import Claim
from companion.navigation.travel_state import Travel, TravelPhase
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.flight.phases import step
from companion.pdps.flight.state import Phase
from companion.pdps.layers import Layers, LayersPhase
from companion.pdps.room_scan_state import RoomScan, ScanPhase
from companion.pdps.viewpoints import Viewpoint
from tests.unit.pdps.flight.flight_ticks import FLYING, PLAN, SILENT, SPACE, after, flying, view


def test_the_drone_flies_home_from_a_closed_room_and_then_descends() -> None:
    closed = replace(flying(Phase.ROOM), room=RoomScan(ScanPhase.CLOSED))
    assert step(closed, view(), PLAN)[0].phase is Phase.HOME
    assert after(Phase.HOME, view(position=(1.0, 0.0)))[0] is Phase.HOME
    arrived, _ = step(flying(Phase.HOME), view(position=(0.05, 0.0)), PLAN)
    assert arrived.phase is Phase.HOME
    over_it = view(position=(0.05, 0.0), time_s=102.5)
    assert step(arrived, over_it, PLAN)[0].phase is Phase.DESCEND


def test_the_drone_descends_over_its_start_before_the_autopilot_lands_it() -> None:
    phase, action = after(Phase.DESCEND, view(position=(0.05, 0.0)))
    assert phase is Phase.DESCEND
    assert action.setpoint is not None
    assert action.setpoint.down_m_s > 0.2
    assert action.setpoint.forward_m_s < 0
    low = view(position=(0.05, 0.0))
    low = replace(
        low, observation=replace(low.observation, pose=replace(low.observation.pose, down_m=-0.45))
    )
    assert after(Phase.DESCEND, low)[0] is Phase.LAND
    assert after(Phase.DESCEND, view(time_s=109.0))[0] is Phase.LAND


def test_the_drone_descends_beside_its_start_if_it_does_not_settle_over_it() -> None:
    arrived, _ = step(flying(Phase.HOME), view(position=(0.05, 0.0)), PLAN)
    beside = view(position=(0.2, 0.0), time_s=102.5)
    assert step(arrived, beside, PLAN)[0].phase is Phase.HOME
    later = view(position=(0.2, 0.0), time_s=104.5)
    assert step(arrived, later, PLAN)[0].phase is Phase.DESCEND


def test_a_low_battery_starts_the_return_and_an_empty_battery_landing() -> None:
    low, empty, unknown = (replace(FLYING, battery=share) for share in (0.15, 0.05, None))
    flight, _ = step(flying(Phase.ROOM), view(low), PLAN)
    assert (flight.phase, flight.trouble) == (Phase.HOME, "turned back with 15 % of the battery")
    assert step(flight, view(low), PLAN)[0].phase is Phase.HOME
    assert step(flight, view(empty), PLAN)[0].phase is Phase.LAND
    assert after(Phase.ROOM, view(unknown))[0] is Phase.ROOM


@pytest.mark.parametrize(
    ("phase", "trouble"),
    [(LayersPhase.EXPLORE, "turned back with 15 % of the battery"), (LayersPhase.OVERFLY, "")],
)
def test_a_mission_is_complete_without_the_rest_of_its_overflight(
    phase: LayersPhase, trouble: str
) -> None:
    began = replace(flying(Phase.LAYERS), layers=Layers(phase))
    flight, _ = step(began, view(replace(FLYING, battery=0.15)), PLAN)
    assert (flight.phase, flight.trouble) == (Phase.HOME, trouble)


@pytest.mark.parametrize("is_extra", [False, True])
def test_a_mission_is_complete_without_the_rest_of_its_extra_rounds(is_extra: bool) -> None:
    began = replace(flying(Phase.ROOM), room=RoomScan(ScanPhase.SCAN, extra_rounds=int(is_extra)))
    flight, _ = step(began, view(replace(FLYING, battery=0.15)), PLAN)
    trouble = "" if is_extra else "turned back with 15 % of the battery"
    assert (flight.phase, flight.trouble) == (Phase.HOME, trouble)


def test_a_mission_is_complete_without_the_rest_of_its_ties() -> None:
    look = Viewpoint((1.0, 1.0), ((4.0, 1.0), (-2.0, 1.0)))
    tie = replace(look, is_tie=True)
    turned_back = "turned back with 15 % of the battery"
    for present, tried, trouble in ((look, (), turned_back), (tie, (), ""), (look, (tie,), "")):
        building = Explore(ExplorePhase.GO, travel=Travel((1.0, 1.0)), look=present, tried=tried)
        began = replace(flying(Phase.BUILDING), building=building)
        flight, _ = step(began, view(replace(FLYING, battery=0.15)), PLAN)
        assert (flight.phase, flight.trouble) == (Phase.HOME, trouble)


@pytest.mark.parametrize("is_extra", [False, True])
def test_a_mission_is_not_complete_while_a_teammate_looks_at_something_unseen(
    *, is_extra: bool
) -> None:
    tie = Viewpoint((1.0, 1.0), ((4.0, 1.0), (-2.0, 1.0)), is_tie=True)
    building = Explore(ExplorePhase.GO, travel=Travel((1.0, 1.0)), look=tie)
    claim = Claim(((9.0, 9.0),), 5.0, is_extra, comes_first=True, from_ne_m=(8.0, 8.0))
    now = view(replace(FLYING, battery=0.15))
    now = replace(now, observation=replace(now.observation, claims=(claim,)))
    flight, _ = step(replace(flying(Phase.BUILDING), building=building), now, PLAN)
    trouble = "" if is_extra else "turned back with 15 % of the battery"
    assert (flight.phase, flight.trouble) == (Phase.HOME, trouble)


def test_the_return_begins_in_time_to_keep_the_reserve() -> None:
    left_s = PLAN.reserve_s + 20
    assert after(Phase.ROOM, view(time_s=90.0 + PLAN.time_limit_s - left_s))[0] is Phase.ROOM
    late = view(time_s=90.0 + PLAN.time_limit_s - PLAN.reserve_s)
    flight, _ = step(flying(Phase.ROOM), late, PLAN)
    assert flight.phase is Phase.HOME
    assert "limit" in flight.trouble


@pytest.mark.parametrize(("battery", "phase"), [(0.2, Phase.ROOM), (0.14, Phase.HOME)])
def test_the_return_begins_while_the_battery_suffices_for_the_path_home(
    battery: float, phase: Phase
) -> None:
    """Discharge of 1 % in 6 s; the path home of 2 m and its turns may take 17 s."""
    began = replace(flying(Phase.ROOM), began_s=0.0, reserve=Reserve((Spent(0.0, 1.0),)))
    seen = view(replace(FLYING, battery=battery), time_s=600.0 * (1 - battery))
    away = replace(
        seen,
        observation=replace(seen.observation, pose=replace(seen.observation.pose, north_m=2.0)),
    )
    plan = PLAN.model_copy(update={"time_limit_s": 3600.0, "battery_home_percent": 0.0})
    assert step(began, away, plan)[0].phase is phase


def test_a_battery_that_sags_at_take_off_does_not_start_the_return() -> None:
    """PX4's simulated battery falls to 50 % within 30 s of arming, and stays there."""
    flight = replace(flying(Phase.BUILDING), began_s=0.0)
    plan = PLAN.model_copy(update={"battery_home_percent": 0.0})
    for second in range(5, 240):
        battery = max(0.5, 1.0 - second / 60)
        seen = view(replace(FLYING, battery=battery), time_s=float(second))
        away = replace(
            seen,
            observation=replace(seen.observation, pose=replace(seen.observation.pose, north_m=9.0)),
        )
        flight, _ = step(flight, away, plan)
        assert flight.phase is Phase.BUILDING, flight.trouble


def test_the_return_begins_earlier_where_the_path_home_is_narrow() -> None:
    """The drone is 6 m along a corridor that is 1.2 m or 4 m wide."""
    turns_back_s = []
    for half_width_m in (0.6, 2.0):
        space = Occupancy()
        for decimetre in range(-10, 80):
            for side in (-1, 1):
                for _ in range(3):
                    eye, bearing_rad = (0.1 * decimetre + 0.05, 0.05), side * math.pi / 2
                    space.add(Ray(eye, bearing_rad, half_width_m, 0.0, True, 0.0))
        far = replace(view(position=(6.0, 0.0)), space=space)
        left_s = 60.0
        while True:
            late = replace(far, time_s=90.0 + PLAN.time_limit_s - PLAN.reserve_s - left_s)
            if step(flying(Phase.BUILDING), late, PLAN)[0].phase is Phase.HOME:
                break
            left_s -= 1.0
        turns_back_s.append(left_s)
    narrow_s, wide_s = turns_back_s
    assert 15 < wide_s < 25
    assert narrow_s > wide_s + 6


def test_the_return_begins_earlier_among_legs() -> None:
    """The path home of 3 m takes 20 s at the speed among legs, not 4 s."""
    plan = PLAN.model_copy(update={"speed_m_s": 1.0})
    late = view(position=(3.0, 0.0), time_s=90.0 + plan.time_limit_s - plan.reserve_s - 20.0)
    among = replace(late, observation=replace(late.observation, legs=4))
    assert step(flying(Phase.ROOM), late, plan)[0].phase is Phase.ROOM
    assert step(flying(Phase.ROOM), among, plan)[0].phase is Phase.HOME


def test_time_limit_and_landing_request_land_the_drone() -> None:
    assert after(Phase.HOME, view(time_s=90.0 + PLAN.time_limit_s + 1))[0] is Phase.LAND
    assert after(Phase.ROOM, view(land_requested=True))[0] is Phase.LAND


def test_without_a_path_home_the_search_is_repeated_before_the_drone_lands() -> None:
    lost, since_s = replace(flying(Phase.HOME), lost_since_s=100.0, lost_s=100.0), 0.0
    lost = replace(lost, way_home=Travel((9.0, 9.0), phase=TravelPhase.GAVE_UP))
    while lost.phase is Phase.HOME and since_s < 100:
        lost, _ = step(lost, view(time_s=100.0 + since_s), PLAN)
        since_s += 1.0
        if lost.way_home.phase is not TravelPhase.GAVE_UP:
            assert lost.way_home.goal_ne_m == (0.0, 0.0)
            lost = replace(lost, way_home=Travel((9.0, 9.0), phase=TravelPhase.GAVE_UP))
    assert 60 < since_s < 70
    assert lost.phase is Phase.LAND
    assert "no way back" in lost.trouble


EMPTY = replace(FLYING, battery=0.05)


def over_a_table() -> Heights:
    """Height map with a table under the drone, which came from the south over floor."""
    floor = Heights(0.0)
    for decimetre in range(12):
        north_m, top_m = 0.1 * decimetre, 0.45 if decimetre > 7 else 0.0
        below = RangeReading(RangeState.DISTANCE, PLAN.height_m - top_m, 1e-4)
        at = Pose(0.0, north_m, 1.0, -PLAN.height_m, 0.0)
        floor.see(RangeScan(0.0, {Beam.DOWN: below}), at)
    return floor


def flown_here() -> Occupancy:
    space = SPACE.copy()
    for decimetre in range(12):
        for degree in range(0, 360, 10):
            space.add(Ray((0.1 * decimetre, 1.0), math.radians(degree), 3.0, 0.0, False, 0.0))
    return space


def test_the_drone_diverts_to_floor_if_it_cannot_land_at_its_start() -> None:
    above = replace(view(EMPTY, floor=over_a_table()), space=flown_here())
    diverted, action = step(flying(Phase.HOME), above, PLAN)
    assert diverted.phase is Phase.DIVERT
    assert action.setpoint is not None
    assert diverted.ending.startswith("flying to a place to land: 5 % of the battery")
    site = diverted.diversion.goal_ne_m if diverted.diversion else (9.0, 9.0)
    assert site[0] < 0.5
    there = replace(
        above, observation=replace(above.observation, pose=Pose(105.0, *site, -1.2, 0.0))
    )
    arrived = replace(diverted, diversion=Travel(site, phase=TravelPhase.ARRIVED))
    descending, _ = step(arrived, there, PLAN)
    assert descending.phase is Phase.DESCEND
    low = replace(there, observation=replace(there.observation, pose=Pose(107.0, *site, -0.4, 0.0)))
    landing, _ = step(descending, low, PLAN)
    assert (landing.phase, landing.trouble) == (Phase.LAND, diverted.trouble)


@pytest.mark.parametrize(
    ("height_m", "reads_m", "phase"),
    [
        *[(1.1, 1.1, Phase.DESCEND), (0.9, 0.9, Phase.DESCEND)],
        *[(0.6, 2.4, Phase.DESCEND)],  # floor, too near to be distinguished
        *[(1.15, 1.45, Phase.DIVERT), (1.1, 1.8, Phase.DIVERT)],  # a table, aliased (folded back)
        (1.1, 0.6, Phase.DIVERT),  # a chair
    ],
)
def test_a_descent_continues_over_floor_and_diverts_over_a_table_or_chair(
    height_m: float, reads_m: float, phase: Phase
) -> None:
    above = replace(view(EMPTY, floor=over_a_table()), space=flown_here())
    descending = replace(flying(Phase.DESCEND), diversion=Travel((1.0, 1.0)), diverted_s=95.0)
    below = RangeReading(RangeState.DISTANCE, reads_m, 1e-4)
    pose = Pose(100.0, 1.0, 1.0, -height_m, 0.0)
    observation = replace(
        above.observation, pose=pose, ranges={**above.observation.ranges, Beam.DOWN: below}
    )
    assert step(descending, replace(above, observation=observation), PLAN)[0].phase is phase


@pytest.mark.parametrize("phase", [Phase.TAKE_OFF, Phase.DESCEND, Phase.HOLD])
def test_an_empty_battery_lands_at_once_during_take_off_descent_and_hold(phase: Phase) -> None:
    fault = SILENT if phase is Phase.HOLD else None
    above = replace(view(EMPTY, fault=fault, floor=over_a_table()), space=flown_here())
    assert step(flying(phase), above, PLAN)[0].phase is Phase.LAND


def test_a_diversion_has_a_time_limit() -> None:
    above = replace(view(EMPTY, floor=over_a_table()), space=flown_here())
    diverted, _ = step(flying(Phase.HOME), above, PLAN)
    late = replace(above, time_s=131.0)
    assert step(diverted, late, PLAN)[0].phase is Phase.LAND


def test_the_path_home_is_flown_when_it_is_free_again() -> None:
    gave_up = Travel((0.0, 0.0), phase=TravelPhase.GAVE_UP)
    lost = replace(flying(Phase.HOME), lost_since_s=100.0, lost_s=100.0, way_home=gave_up)
    assert step(lost, view(time_s=103.0), PLAN)[0].way_home.phase is TravelPhase.GAVE_UP
    again, _ = step(lost, view(time_s=106.0), PLAN)
    assert again.way_home.phase is TravelPhase.FLY
    assert "searching again" in again.notice
    _, action = step(again, view(time_s=106.1), PLAN)
    assert action.setpoint is not None
    assert again.way_home.goal_ne_m == (0.0, 0.0)
