"""Tests of the state that a drone tells its teammates."""

import pytest

from companion.core.messages import Pose
from companion.navigation.doorways import Doorway
from companion.navigation.travel_state import Travel
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.flight.state import FlightState, Phase
from companion.safety.separation import Passing
from companion.team.flight_state import state_of
from companion.team.messages import State


def told(phase: Phase, height_m: float) -> State:
    pose = Pose(100.0, 0.0, 0.0, -height_m, 0.0)
    return state_of(FlightState(phase), pose, (0.0, 0.0), battery=None, received={}, links={})


@pytest.mark.parametrize(
    ("phase", "height_m", "is_flying", "needs_column"),
    [
        (Phase.ARM, 0.0, False, False),
        (Phase.TAKE_OFF, 0.2, True, True),
        (Phase.BUILDING, 1.2, True, False),
        (Phase.HOME, 1.2, True, False),
        (Phase.LAND, 1.0, True, True),
        (Phase.LAND, 0.2, False, False),
        (Phase.DONE, 0.0, False, False),
    ],
)
def test_a_drone_is_in_the_air_until_it_is_below_all_others(
    phase: Phase, height_m: float, *, is_flying: bool, needs_column: bool
) -> None:
    state = told(phase, height_m)
    assert (state.is_flying, state.needs_column) == (is_flying, needs_column)


@pytest.mark.parametrize("lets_pass", [False, True])
def test_a_drone_that_lets_a_teammate_pass_claims_no_doorway(*, lets_pass: bool) -> None:
    """The teammate may wait for the same doorway, so neither would go on."""
    doorway = Doorway(0, (1.0, 0.0), (1.0, 0.0), 0.5)
    journey = Travel((5.0, 0.0), doorways=(doorway,))
    flight = FlightState(
        Phase.BUILDING,
        building=Explore(ExplorePhase.GO, travel=journey),
        passing=Passing((0.0, 0.0), 2.5) if lets_pass else None,
    )
    pose = Pose(100.0, 0.0, 0.0, -1.2, 0.0)
    state = state_of(flight, pose, (0.0, 0.0), battery=None, received={}, links={})
    assert state.doorway_ne_m == (None if lets_pass else doorway.middle_ne_m)
