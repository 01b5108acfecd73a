"""A building is mapped layer by layer."""

import pytest

from companion.config.settings import MissionConfig
from companion.core.messages import HOLD, Beam, Pose, RangeReading, RangeState
from companion.mapping.occupancy import Occupancy
from companion.navigation.observation import Observation
from companion.navigation.travel_state import Travel, TravelPhase
from companion.pdps import layers as layering
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.layers import Layers, LayersPhase
from tests.grids import observation, open_ground, walled

LAYERED = MissionConfig(kind="layers")


def layer_sight(above_m: float, height_m: float = LAYERED.height_m) -> Observation:
    up = RangeReading(RangeState.DISTANCE, above_m, 0.01)
    at = Pose(10.0, 0.0, 0.0, -height_m, 0.0)
    return Observation(at, {Beam.FRONT: up, Beam.UP: up}, 0.0)


def test_a_layer_that_was_seen_ends_at_the_start() -> None:
    seen = Layers(explore=Explore(ExplorePhase.DONE))
    layers, _ = layering.step(seen, layer_sight(3.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.RETURN


def test_from_the_start_it_climbs_while_there_is_room_above() -> None:
    back = Layers(LayersPhase.RETURN)
    layers, _ = layering.step(back, layer_sight(2.5), open_ground(), LAYERED)
    assert (layers.phase, layers.number) == (LayersPhase.CLIMB, 1)
    assert layers.height_m(LAYERED) == pytest.approx(LAYERED.height_m + LAYERED.layer_spacing_m)
    layers, _ = layering.step(back, layer_sight(1.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.OVERFLY


def test_without_a_way_back_the_layers_end() -> None:
    lost = Layers(LayersPhase.RETURN, travel=Travel((9.0, 9.0), phase=TravelPhase.GAVE_UP))
    layers, _ = layering.step(lost, layer_sight(3.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.DONE


def test_at_its_new_height_it_looks_round_first() -> None:
    climbing = Layers(LayersPhase.CLIMB, number=1)
    layers, _ = layering.step(climbing, layer_sight(3.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.CLIMB
    there = layer_sight(3.0, climbing.height_m(LAYERED))
    layers, _ = layering.step(climbing, there, Occupancy(), LAYERED)
    assert (layers.phase, layers.number) == (LayersPhase.EXPLORE, 1)
    assert layers.explore == Explore()


def test_all_layers_seen_stays_so() -> None:
    layers, setpoint = layering.step(Layers(LayersPhase.DONE), observation(), walled(), LAYERED)
    assert layers.phase is LayersPhase.DONE
    assert setpoint == HOLD
