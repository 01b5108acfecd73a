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


def test_the_drone_returns_to_the_start_after_a_layer() -> None:
    seen = Layers(explore=Explore(ExplorePhase.DONE))
    layers, _ = layering.step(seen, layer_sight(3.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.RETURN


def test_the_drone_climbs_at_the_start_while_there_is_room_above() -> None:
    back = Layers(LayersPhase.RETURN)
    layers, _ = layering.step(back, layer_sight(2.5), open_ground(), LAYERED)
    assert (layers.phase, layers.number) == (LayersPhase.CLIMB, 1)
    assert layers.height_m(LAYERED) == pytest.approx(LAYERED.height_m + LAYERED.layer_spacing_m)
    layers, _ = layering.step(back, layer_sight(1.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.OVERFLY


def test_layers_end_without_a_path_back() -> None:
    lost = Layers(LayersPhase.RETURN, travel=Travel((9.0, 9.0), phase=TravelPhase.GAVE_UP))
    layers, _ = layering.step(lost, layer_sight(3.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.DONE


def test_exploration_of_a_layer_begins_at_its_height() -> None:
    climbing = Layers(LayersPhase.CLIMB, number=1)
    layers, _ = layering.step(climbing, layer_sight(3.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.CLIMB
    there = layer_sight(3.0, climbing.height_m(LAYERED))
    layers, _ = layering.step(climbing, there, Occupancy(), LAYERED)
    assert (layers.phase, layers.number) == (LayersPhase.EXPLORE, 1)
    assert layers.explore == Explore()


def test_done_layers_stay_done() -> None:
    layers, setpoint = layering.step(Layers(LayersPhase.DONE), observation(), walled(), LAYERED)
    assert layers.phase is LayersPhase.DONE
    assert setpoint == HOLD
