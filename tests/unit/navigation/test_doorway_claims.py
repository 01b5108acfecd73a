"""One drone of a team at a time passes a doorway."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import Pose
from companion.mapping.occupancy import CELL_M
from companion.navigation import travel as travelling
from companion.navigation.doorway_claims import (
    MAX_WAIT_S,
    OFF_M,
    WAIT_WITHIN_M,
    claimed,
    out_of_the_way,
    waiting,
)
from companion.navigation.doorways import DOORWAY_ROOM_M, Doorway
from companion.navigation.observation import DoorwayClaim, Observation
from companion.navigation.travel_state import Travel, TravelPhase
from companion.pdps.flight.state import FlightState, Phase
from companion.pdps.layers import Layers, LayersPhase
from tests.grids import PLAN, open_ground, walled, ways_from

DOORWAY = Doorway(0, (3.0, 0.0), (1.0, 0.0), 0.5)
"""On the way to the north."""
THERE = Travel((6.0, 0.0), doorways=(DOORWAY,))
BACK = Travel((0.0, 0.0), doorways=(replace(DOORWAY, through_ne=(-1.0, 0.0)),))


def at(north_m: float, *claims: DoorwayClaim, time_s: float = 0.0) -> Observation:
    pose = Pose(time_s, north_m, 0.0, -1.2, 0.0)
    return Observation(pose, {}, 0.08, doorway_claims=claims)


def waits(travel: Travel, seen: Observation) -> bool:
    return waiting(travel, seen).waits_at_ne_m is not None


def claim(north_m: float, *, comes_first: bool = False, goes_home: bool = False) -> DoorwayClaim:
    """Of a teammate in line with the doorway."""
    return DoorwayClaim(DOORWAY.middle_ne_m, (north_m, 0.0), comes_first, goes_home)


@given(st.floats(0.45, 1.95), st.floats(0.0, 2.9), st.booleans())
def test_one_of_two_drones_waits_and_the_other_goes(
    before_m: float, beyond_m: float, first_has_priority: bool
) -> None:
    """Also if both are so near that none can leave the doorway past the other."""
    south_m, north_m = 3.0 - before_m, 3.0 + beyond_m
    first_waits = waits(THERE, at(south_m, claim(north_m, comes_first=not first_has_priority)))
    second_waits = waits(BACK, at(north_m, claim(south_m, comes_first=first_has_priority)))
    assert not (first_waits and second_waits)
    if beyond_m < 1.95:
        assert first_waits or second_waits


@given(st.floats(0.45, 1.95), st.floats(0.45, 1.95), st.booleans())
def test_a_drone_that_flies_home_goes_first(
    before_m: float, beyond_m: float, first_has_priority: bool
) -> None:
    south_m, north_m = 3.0 - before_m, 3.0 + beyond_m
    homeward = at(south_m, claim(north_m, comes_first=not first_has_priority))
    assert not waits(THERE, replace(homeward, goes_home=True))
    assert waits(BACK, at(north_m, claim(south_m, comes_first=first_has_priority, goes_home=True)))


@pytest.mark.parametrize("north_m", [2.8, 3.2, 2.4])
def test_a_drone_that_flies_home_waits_for_one_in_the_doorway_or_just_out_of_it(
    north_m: float,
) -> None:
    assert waits(THERE, replace(at(1.5, claim(north_m)), goes_home=True))


def test_a_drone_that_looks_for_its_way_claims_no_doorway() -> None:
    assert claimed(THERE, (2.0, 0.0)) == DOORWAY
    assert claimed(replace(THERE, phase=TravelPhase.SWEEP), (2.0, 0.0)) is None


@pytest.mark.parametrize("north_m", [1.5, 2.4])
def test_a_drone_waits_off_the_doorway_until_the_other_has_passed(north_m: float) -> None:
    """It goes straight back to where the other has room to leave the doorway."""
    inside = claim(3.1)
    travel, setpoint = travelling.step(THERE, at(north_m, inside), open_ground(), PLAN)
    assert setpoint.forward_m_s < 0
    assert travel.waits_at_ne_m == pytest.approx((3.0 - OFF_M, 0.0))
    assert not waits(travel, at(1.5, time_s=2.0))


def test_a_drone_does_not_wait_for_ever() -> None:
    """The other may be stuck in the doorway."""
    stuck = claim(3.2, comes_first=True)
    travel = waiting(THERE, at(1.5, stuck))
    assert waits(travel, at(1.5, stuck, time_s=MAX_WAIT_S - 1))
    assert not waits(travel, at(1.5, stuck, time_s=MAX_WAIT_S + 1))


@pytest.mark.parametrize("north_m", [0.5, 2.7, 3.5])
def test_a_drone_waits_neither_far_away_nor_in_the_doorway_nor_behind_it(north_m: float) -> None:
    assert not waits(THERE, at(north_m, claim(3.1, comes_first=True)))


def test_another_doorway_is_free() -> None:
    there = DoorwayClaim((3.0, 2.0), (3.1, 2.0), comes_first=True)
    assert not waits(THERE, at(1.5, there))


def test_a_doorway_that_was_passed_is_not_claimed() -> None:
    assert claimed(THERE, (2.0, 0.0)) == DOORWAY
    assert claimed(THERE, (3.5, 0.0)) == DOORWAY
    assert claimed(THERE, (4.0, 0.0)) is None
    assert claimed(THERE, (-1.0, 0.0)) is None


def test_a_drone_that_waits_on_its_way_back_from_a_layer_lets_the_other_pass() -> None:
    """Others see that it waits, and have the right of way."""
    at_doorway = replace(BACK, waits_at_ne_m=(4.5, 0.0))
    layers = Layers(LayersPhase.RETURN, travel=at_doorway)
    flight = FlightState(Phase.LAYERS, layers=layers)
    assert flight.travel is at_doorway
    assert flight.waits
    assert not replace(flight, layers=Layers(LayersPhase.RETURN, travel=BACK)).waits


@given(st.floats(-2.2, 2.2), st.floats(-1.0, 1.0))
def test_a_drone_without_a_target_waits_in_the_open_and_off_the_doorway(
    north_m: float, east_m: float
) -> None:
    """Its teammates pass the doorway meanwhile."""
    ways = ways_from(walled(), (north_m, east_m))
    place = out_of_the_way(ways, [DOORWAY])
    assert place is not None
    assert math.dist(place, DOORWAY.middle_ne_m) > WAIT_WITHIN_M - CELL_M
    assert ways.ground.clear_m(place) >= DOORWAY_ROOM_M
    is_off = math.dist((north_m, east_m), DOORWAY.middle_ne_m) > WAIT_WITHIN_M + 0.2
    if is_off and ways.ground.clear_m((north_m, east_m)) >= DOORWAY_ROOM_M:
        assert math.dist(place, (north_m, east_m)) < 0.1


def test_no_place_to_wait_is_far_enough_from_two_doorways_in_a_small_room() -> None:
    south = replace(DOORWAY, middle_ne_m=(-1.5, 0.0))
    north = replace(DOORWAY, middle_ne_m=(1.5, 0.0))
    ways = ways_from(walled(reach_m=1.5), (0.0, 0.0))
    assert out_of_the_way(ways, [south, north]) is None
