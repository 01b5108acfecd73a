"""Tests that the drones of a team divide the layers, and leave none unseen."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.settings import MissionConfig
from companion.core.messages import Beam, Pose, RangeReading, RangeState
from companion.mapping.occupancy import Occupancy
from companion.navigation.observation import LayerClaim, Observation, TeamLayers
from companion.navigation.travel_state import Travel, TravelPhase
from companion.pdps import layers
from companion.pdps.claims import Choice, first_layer, is_complete, wanted_layers
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.layers import Layers, LayersPhase
from companion.pdps.overflight import Overfly, OverflyPhase
from tests.grids import open_ground, walled

LAYERED = MissionConfig(kind="layers")
NO_LAYER = frozenset[int]()
UNKNOWN, SEEN = Occupancy(), walled()


def sight(
    *claims: LayerClaim,
    seen: tuple[int, ...] = (),
    spaces: tuple[Occupancy, ...] = (SEEN, UNKNOWN, UNKNOWN),
    above_m: float = 2.0,
    height_m: float = LAYERED.height_m,
) -> Observation:
    """What a drone over its start knows of the layers; three fit under the ceiling."""
    up = RangeReading(RangeState.DISTANCE, above_m, 0.01)
    team = TeamLayers(claims, frozenset(seen), spaces.__getitem__, lambda _: np.empty((0, 2)))
    at = Pose(10.0, 0.0, 0.0, -height_m, 0.0)
    return Observation(at, {Beam.UP: up}, 0.0, team_layers=team)


def chosen(begun: Layers, seen: Observation, ticks: int = 5) -> Layers:
    """The state after some ticks of choosing."""
    for _ in range(ticks):
        if begun.phase is LayersPhase.CHOOSE:
            begun, _ = layers.step(begun, seen, open_ground(), LAYERED)
    return begun


def test_the_first_drone_begins_at_the_lowest_layer_and_the_second_at_the_highest() -> None:
    assert first_layer(0, 3, (LayerClaim(0, comes_first=False),)) == 0
    assert first_layer(0, 3, (LayerClaim(0, comes_first=True),)) == 3
    assert first_layer(0, 3, ()) == 0


@given(st.integers(1, 8), st.integers(0, 9))
def test_drones_that_choose_at_the_same_time_begin_in_different_layers(
    drones: int, top: int
) -> None:
    claims = tuple(LayerClaim(0, comes_first=True) for _ in range(drones))
    begun = [first_layer(0, top, claims[:before]) for before in range(drones)]
    assert len(set(begun)) == min(drones, top + 1)


def test_a_drone_takes_the_nearest_layer_that_nobody_has() -> None:
    claims = (LayerClaim(1, comes_first=False),)
    assert wanted_layers(Choice(4), 0, frozenset({0}), claims)[0] == 2
    assert wanted_layers(Choice(4), 4, frozenset({4}), claims)[0] == 3


def test_a_drone_helps_where_a_teammate_is_if_no_other_layer_is_left() -> None:
    claims = (LayerClaim(1, comes_first=True),)
    assert wanted_layers(Choice(2), 2, frozenset({0, 2}), claims) == [1]


def test_the_layer_of_a_drone_that_has_landed_is_taken_over() -> None:
    assert wanted_layers(Choice(1), 1, frozenset({1}), ()) == [0]


def test_a_layer_was_seen_only_if_all_below_were_seen_and_nobody_is_there() -> None:
    assert is_complete(1, frozenset({0}), ())
    assert not is_complete(1, NO_LAYER, ())
    assert not is_complete(0, NO_LAYER, (LayerClaim(0, comes_first=False),))


def test_after_the_first_turn_the_second_drone_climbs_to_the_highest_layer() -> None:
    turned = Layers(explore=Explore(ExplorePhase.CHOOSE))
    seen = sight(LayerClaim(0, comes_first=True))
    undecided, _ = layers.step(turned, seen, SEEN, LAYERED)
    climbing = chosen(undecided, seen)
    assert (climbing.phase, climbing.number) == (LayersPhase.CLIMB, 2)


def test_a_drone_at_the_highest_layer_descends_to_the_next() -> None:
    seen = replace(Layers(LayersPhase.RETURN), number=2, choice=Choice(2))
    back = replace(seen, travel=Travel((0.0, 0.0), phase=TravelPhase.ARRIVED))
    below = sight(LayerClaim(0, comes_first=True), spaces=(SEEN, UNKNOWN, SEEN), above_m=0.6)
    arrived, _ = layers.step(back, below, SEEN, LAYERED)
    descending = chosen(arrived, below)
    assert (descending.phase, descending.number) == (LayersPhase.CLIMB, 1)


def test_a_layer_in_which_nothing_is_left_is_told_as_seen() -> None:
    seen = chosen(Layers(LayersPhase.CHOOSE, choice=Choice(2)), sight(spaces=(SEEN,) * 3), 3)
    assert seen.seen == {0, 1, 2}


def test_while_a_teammate_has_the_last_layer_a_drone_at_the_highest_flies_over_it() -> None:
    last = sight(LayerClaim(1, comes_first=True), seen=(0,), spaces=(SEEN,) * 3, above_m=0.6)
    over = chosen(Layers(LayersPhase.CHOOSE, choice=Choice(2), number=2), last)
    assert over.phase is LayersPhase.OVERFLY


def test_a_drone_with_nothing_to_fly_over_waits_for_the_teammate_in_the_last_layer() -> None:
    last = sight(LayerClaim(1, comes_first=True), seen=(0,), spaces=(SEEN,) * 3, above_m=0.6)
    flown = Overfly(OverflyPhase.DONE)
    begun = Layers(LayersPhase.CHOOSE, choice=Choice(2), number=2, overfly=flown)
    waiting = chosen(begun, last)
    assert waiting.phase is LayersPhase.CHOOSE
    assert waiting.seen == {0}


@pytest.mark.parametrize(("reach_m", "phase"), [(3.0, "CLIMB"), (0.6, "DONE")])
def test_when_all_was_seen_the_team_flies_over_what_is_left(reach_m: float, phase: str) -> None:
    """A small room is covered from the start."""
    spaces = (SEEN, SEEN, walled(reach_m=reach_m))
    ended = chosen(
        Layers(LayersPhase.CHOOSE, choice=Choice(2)), sight(seen=(0, 1, 2), spaces=spaces)
    )
    assert ended.phase is LayersPhase[phase]


def test_the_flight_over_everything_begins_at_the_highest_layer() -> None:
    everything = frozenset({0, 1, 2})
    climbing = Layers(LayersPhase.CLIMB, number=2, seen=everything, choice=Choice(2))
    there = sight(height_m=climbing.height_m(LAYERED))
    over, _ = layers.step(climbing, there, SEEN, LAYERED)
    assert over.phase is LayersPhase.OVERFLY


def test_a_drone_that_meets_no_ceiling_knows_one_layer_more() -> None:
    nothing = RangeReading(RangeState.NOTHING)
    open_air = replace(sight(LayerClaim(0, comes_first=True)), ranges={Beam.UP: nothing})
    climbing = chosen(Layers(LayersPhase.CHOOSE), open_air)
    assert (climbing.phase, climbing.number) == (LayersPhase.CLIMB, 1)
