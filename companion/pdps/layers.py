"""State machine that explores a building at several heights, one layer after the other.

    EXPLORE ──all seen──► RETURN ──at the start──► CLIMB ──► EXPLORE, one layer higher
                           │  │ the ceiling is near
              no path back │  ▼
                           │ OVERFLY ──► DONE
                           └──────────────▲

An obstacle at one height need not exist at another. So each layer has its own occupancy grid, in
which only the column over the start is known at first. In a survey it also has what earlier flights
saw in that layer; where nothing is left to see, the drone climbs at once. From the highest layer
it flies over everything once, because the down beam measures tables only from 1 m above them.

Safety: the drone climbs only over its start, and keeps its clearance to the ceiling.
"""

import enum
import math
from dataclasses import dataclass, field, replace

from companion.config.settings import MissionConfig
from companion.core.messages import HOLD, Beam, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.navigation import travel
from companion.navigation.grid_planner import START_NE_M
from companion.navigation.observation import Observation
from companion.navigation.travel_state import Travel, TravelPhase
from companion.pdps import explore, overflight
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.overflight import Overfly, OverflyPhase
from companion.pdps.viewpoints import Viewpoint
from companion.safety.control_laws import stay

AT_HEIGHT_M = 0.08
"""Maximum height error at which a layer counts as reached, m. Chosen."""
OVER_HEAD_M = 0.25
"""Margin between the drone's centre and the ceiling, beyond the clearance, m. Chosen."""
TO_START = Travel(START_NE_M)
"""Journey back to the start."""


class LayersPhase(enum.Enum):
    """States of the diagram above."""

    EXPLORE = "exploring a layer"
    RETURN = "returning to climb"
    CLIMB = "climbing to the next layer"
    OVERFLY = "flying over everything"
    DONE = "all layers were seen"


@dataclass(frozen=True, slots=True)
class Layers:
    """State of the mission over all layers."""

    phase: LayersPhase = LayersPhase.EXPLORE
    number: int = 0
    """Number of the layer, from the lowest, which is 0."""
    explore: Explore = field(default_factory=Explore)
    travel: Travel = TO_START
    overfly: Overfly = field(default_factory=Overfly)
    looked: tuple[tuple[Viewpoint, ...], ...] = ()
    """Viewpoints in each layer explored before, also by earlier flights, from the lowest."""

    @classmethod
    def on(cls, number: int, looked: tuple[tuple[Viewpoint, ...], ...]) -> "Layers":
        """The state at the begin of a layer."""
        tried = looked[number] if number < len(looked) else ()
        is_known = number > 0 and bool(tried)  # the turn at the lowest layer corrects the heading
        phase = ExplorePhase.CHOOSE if is_known else ExplorePhase.LOOK
        return cls(number=number, explore=Explore(phase, tried=tried), looked=looked)

    @property
    def all_looked(self) -> tuple[tuple[Viewpoint, ...], ...]:
        """Viewpoints in each layer so far."""
        if self.phase is not LayersPhase.EXPLORE:
            return self.looked
        return (*self.looked[: self.number], self.explore.tried, *self.looked[self.number + 1 :])

    def height_m(self, plan: MissionConfig) -> float:
        """Height of the present layer, m."""
        return layer_height_m(self.number, plan)

    @property
    def is_extra(self) -> bool:
        """True if all layers were seen. The rest of the mission may end early."""
        return self.phase is LayersPhase.OVERFLY

    @property
    def activity(self) -> str:
        """Description of the phase, or of the sub-phase while exploring."""
        if self.phase is LayersPhase.EXPLORE:
            return self.explore.activity
        return str(self.phase.value)


def layer_height_m(number: int, plan: MissionConfig) -> float:
    """Height of a layer, m."""
    return plan.height_m + number * plan.layer_spacing_m


def step(
    layers: Layers, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Layers, Setpoint]:
    """Runs one tick. Returns the next state and the velocity setpoint.

    `space` is the occupancy grid of the present layer.
    """
    match layers.phase:
        case LayersPhase.EXPLORE:
            return _explore(layers, observation, space, plan)
        case LayersPhase.RETURN:
            return _return(layers, observation, space, plan)
        case LayersPhase.CLIMB:
            return _climb(layers, observation, plan)
        case LayersPhase.OVERFLY:
            return _overfly(layers, observation, space, plan)
        case LayersPhase.DONE:
            return layers, HOLD


def _explore(
    layers: Layers, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Layers, Setpoint]:
    exploring, setpoint = explore.step(layers.explore, observation, space, plan)
    layers = replace(layers, explore=exploring)
    if exploring.phase is ExplorePhase.DONE:
        looked = layers.all_looked
        back = replace(layers, phase=LayersPhase.RETURN, travel=TO_START, looked=looked)
        return back, setpoint
    return layers, setpoint


def _overfly(
    layers: Layers, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Layers, Setpoint]:
    over, setpoint = overflight.step(layers.overfly, observation, space, plan)
    phase = LayersPhase.DONE if over.phase is OverflyPhase.DONE else layers.phase
    return replace(layers, phase=phase, overfly=over), setpoint


def _return(
    layers: Layers, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Layers, Setpoint]:
    going, setpoint = travel.step(layers.travel, observation, space, plan)
    if going.phase is TravelPhase.ARRIVED:
        if fits_above(observation.clear_m(Beam.UP), plan):
            higher = replace(layers, phase=LayersPhase.CLIMB, number=layers.number + 1)
            return higher, setpoint
        return replace(layers, phase=LayersPhase.OVERFLY), setpoint
    if going.phase is TravelPhase.GAVE_UP:
        return replace(layers, phase=LayersPhase.DONE), setpoint
    return replace(layers, travel=going), setpoint


def fits_above(above_m: float, plan: MissionConfig) -> bool:
    """True if the room above the drone, m, is enough for the next layer."""
    return above_m >= plan.layer_spacing_m + plan.clearance_m + OVER_HEAD_M or math.isinf(above_m)


def _climb(
    layers: Layers, observation: Observation, plan: MissionConfig
) -> tuple[Layers, Setpoint]:
    if abs(observation.pose.height_m - layers.height_m(plan)) < AT_HEIGHT_M:
        return Layers.on(layers.number, layers.looked), HOLD
    return layers, stay(START_NE_M, observation.pose)
