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


@given(st.floats(0.8, 1.95), st.floats(0.0, 2.9), st.booleans())
def test_one_of_two_drones_waits_and_the_other_goes(
    before_m: float, beyond_m: float, first_has_priority: bool
) -> None:
    first = DoorwayClaim((3.0, 0.0), before_m, first_has_priority)
    second = DoorwayClaim((3.1, 0.1), beyond_m, not first_has_priority)
    first_waits = waits(THERE, at(3.0 - before_m, second))
    second_waits = waits(BACK, at(3.0 + beyond_m, first))
    assert not (first_waits and second_waits)
    if 0.8 < beyond_m < 1.95:
        assert first_waits or second_waits


@given(st.floats(0.8, 1.95), st.floats(0.8, 1.95), st.booleans())
def test_a_drone_that_flies_home_goes_first(
    before_m: float, beyond_m: float, first_has_priority: bool
) -> None:
    first = DoorwayClaim((3.0, 0.0), before_m, first_has_priority, goes_home=True)
    second = DoorwayClaim((3.0, 0.0), beyond_m, not first_has_priority)
    assert not waits(THERE, replace(at(3.0 - before_m, second), goes_home=True))
    assert waits(BACK, at(3.0 + beyond_m, first))


def test_a_drone_that_flies_home_waits_for_one_in_the_doorway() -> None:
    inside = DoorwayClaim((3.0, 0.0), 0.2, comes_first=False)
    assert waits(THERE, replace(at(1.5, inside), goes_home=True))


def test_a_drone_that_looks_for_its_way_claims_no_doorway() -> None:
    assert claimed(THERE, (2.0, 0.0)) == DOORWAY
    assert claimed(replace(THERE, phase=TravelPhase.SWEEP), (2.0, 0.0)) is None


def test_a_drone_waits_at_its_place_until_the_other_has_passed() -> None:
    inside = DoorwayClaim((3.0, 0.0), 0.2, comes_first=False)
    travel, _ = travelling.step(THERE, at(1.5, inside), open_ground(), PLAN)
    assert travel.waits_at_ne_m == (1.5, 0.0)
    _, setpoint = travelling.step(travel, at(1.7, inside, time_s=1.0), open_ground(), PLAN)
    assert setpoint.forward_m_s < 0  # it has drifted towards the doorway
    assert not waits(travel, at(1.5, time_s=2.0))


def test_a_drone_does_not_wait_for_ever() -> None:
    """The other may be stuck in the doorway."""
    stuck = DoorwayClaim((3.0, 0.0), 0.2, comes_first=True)
    travel = waiting(THERE, at(1.5, stuck))
    assert waits(travel, at(1.5, stuck, time_s=MAX_WAIT_S - 1))
    assert not waits(travel, at(1.5, stuck, time_s=MAX_WAIT_S + 1))


@pytest.mark.parametrize("north_m", [0.5, 2.5, 3.5])
def test_a_drone_waits_neither_far_away_nor_in_the_doorway(north_m: float) -> None:
    assert not waits(THERE, at(north_m, DoorwayClaim((3.0, 0.0), 0.1, comes_first=True)))


def test_another_doorway_is_free() -> None:
    assert not waits(THERE, at(1.5, DoorwayClaim((3.0, 2.0), 0.1, comes_first=True)))


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
