"""State machine that explores a building at several heights, one layer after the other.

    EXPLORE ──all seen──► RETURN ──at the start──► CLIMB ──► EXPLORE, one layer higher
                           │  │ the ceiling is near
              no path back │  ▼
                           │ OVERFLY ──► DONE
                           └──────────────▲
    in a team: RETURN ──at the start──► CHOOSE ──► CLIMB, or descend, to the layer that is left

An obstacle at one height need not exist at another. So each layer has its own occupancy grid, in
which only the column over the start is known at first. In a survey it also has what earlier flights
saw in that layer; where nothing is left to see, the drone climbs at once. From the highest layer
it flies over everything once, because the down beam measures tables only from 1 m above them.

A team divides the layers (`claims.py`).

Safety: the drone climbs only over its start, and keeps its clearance to the ceiling.
"""

import enum
import math
from dataclasses import dataclass, field, replace

from companion.config.settings import MissionConfig
from companion.config.team import MAX_LAYERS
from companion.core.messages import HOLD, Beam, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.navigation import travel
from companion.navigation.grid_planner import START_NE_M, find_ground, find_ways
from companion.navigation.observation import Observation, TeamLayers
from companion.navigation.travel_state import Travel, TravelPhase
from companion.pdps import explore, overflight
from companion.pdps.claims import Choice, first_layer, is_complete, is_others_layer, wanted_layers
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.overflight import Overfly, OverflyPhase
from companion.pdps.viewpoints import Viewpoint, looks
from companion.safety import fence
from companion.safety.control_laws import stay
from companion.safety.velocity_guard import clear_of_all_m

AT_HEIGHT_M = 0.08
"""Maximum height error at which a layer counts as reached, m. Chosen."""
OVER_HEAD_M = 0.25
"""Margin between the drone's centre and the ceiling, beyond the clearance, m. Chosen."""
CHOOSES_AGAIN_S = 2.0
"""Time of waiting before the layers are examined again, in a team, s. Chosen."""
TO_START = Travel(START_NE_M)
"""Journey back to the start."""


class LayersPhase(enum.Enum):
    """States of the diagram above."""

    EXPLORE = "exploring a layer"
    RETURN = "returning to change the layer"
    CHOOSE = "choosing a layer"
    CLIMB = "going to the next layer"
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
    seen: frozenset[int] = frozenset()
    """In a team: layers of which it is known that they were seen."""
    choice: Choice | None = None
    """In a team: the choice of the next layer; None until the first."""

    @classmethod
    def on(cls, number: int, looked: tuple[tuple[Viewpoint, ...], ...]) -> "Layers":
        """The state at the begin of a layer."""
        layers = cls(number=number, looked=looked)
        is_known = number > 0 and bool(layers.tried_in(number))
        return layers.exploring(turns=not is_known)  # the turn at the lowest corrects the heading

    def exploring(self, *, turns: bool) -> "Layers":
        """The state at the begin of its layer. `turns`: the drone looks round first."""
        phase = ExplorePhase.LOOK if turns else ExplorePhase.CHOOSE
        exploring = Explore(phase, tried=self.tried_in(self.number))
        return replace(self, phase=LayersPhase.EXPLORE, explore=exploring)

    def tried_in(self, number: int) -> tuple[Viewpoint, ...]:
        """Viewpoints in a layer explored before."""
        return self.looked[number] if number < len(self.looked) else ()

    @property
    def all_looked(self) -> tuple[tuple[Viewpoint, ...], ...]:
        """Viewpoints in each layer so far."""
        if self.phase is not LayersPhase.EXPLORE:
            return self.looked
        below = (self.tried_in(number) for number in range(self.number))
        return (*below, self.explore.tried, *self.looked[self.number + 1 :])

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
        case LayersPhase.CHOOSE:
            return _choose(layers, observation, plan), stay(START_NE_M, observation.pose)
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
    is_undecided = observation.team_layers is not None and layers.choice is None
    if is_undecided and exploring.phase is not ExplorePhase.LOOK:
        return replace(layers, phase=LayersPhase.CHOOSE), setpoint
    if exploring.phase is ExplorePhase.DONE:
        looked = layers.all_looked
        back = replace(layers, phase=LayersPhase.RETURN, travel=TO_START, looked=looked)
        return back, setpoint
    return layers, setpoint


def _overfly(
    layers: Layers, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Layers, Setpoint]:
    over, setpoint = overflight.step(layers.overfly, observation, space, plan, layers.number)
    layers = replace(layers, overfly=over)
    if over.phase is not OverflyPhase.DONE:
        return layers, setpoint
    team, choice = observation.team_layers, layers.choice
    if team is None or choice is None or choice.is_all_seen(layers.seen | team.seen):
        return replace(layers, phase=LayersPhase.DONE), setpoint
    return replace(layers, phase=LayersPhase.RETURN, travel=TO_START), setpoint


def _return(
    layers: Layers, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Layers, Setpoint]:
    going, setpoint = travel.step(layers.travel, observation, space, plan)
    if going.phase is TravelPhase.ARRIVED:
        if observation.team_layers is not None:
            return replace(layers, phase=LayersPhase.CHOOSE), setpoint
        if fits_above(_above_layer_m(layers.number, observation, plan), layers.number, plan):
            higher = replace(layers, phase=LayersPhase.CLIMB, number=layers.number + 1)
            return higher, setpoint
        return replace(layers, phase=LayersPhase.OVERFLY), setpoint
    if going.phase is TravelPhase.GAVE_UP:
        return replace(layers, phase=LayersPhase.DONE), setpoint
    return replace(layers, travel=going), setpoint


def _choose(layers: Layers, observation: Observation, plan: MissionConfig) -> Layers:
    """Chooses the next layer in a team. At most one map is examined in a tick."""
    team = observation.team_layers
    assert team is not None
    top = _highest(layers.choice, layers.number, observation, plan)
    if layers.choice is None:
        return _go(layers, first_layer(layers.number, top, team.claims), Choice(top))
    choice = replace(layers.choice, top=top)
    layers = replace(layers, seen=layers.seen | team.seen, choice=choice)
    if not choice.is_all_seen(layers.seen):
        return _examine(layers, choice, team, observation, plan)
    if overflight.is_left(layers.overfly, observation, team.space(top), plan, top):
        return _go(layers, top, choice)
    return replace(layers, phase=LayersPhase.DONE)


def _examine(
    layers: Layers, choice: Choice, team: TeamLayers, observation: Observation, plan: MissionConfig
) -> Layers:
    """Examines the best layer, and goes on there if anything is left to see.

    While teammates have all that are left, a drone at the highest layer flies over everything.
    """
    now_s = observation.pose.time_s
    wanted = wanted_layers(choice, layers.number, layers.seen, team.claims)
    helps = not wanted or is_others_layer(wanted[0], layers.number, team.claims)
    is_due = layers.number == choice.top and layers.overfly.phase is not OverflyPhase.DONE
    if helps and is_due:
        return replace(layers, phase=LayersPhase.OVERFLY)
    if not wanted:
        is_due = now_s - choice.since_s > CHOOSES_AGAIN_S
        return replace(layers, choice=Choice(choice.top, since_s=now_s)) if is_due else layers
    number, tried = wanted[0], layers.tried_in(wanted[0])
    if _is_left(team.space(number), tried, observation, plan):
        return _go(layers, number, Choice(choice.top, since_s=now_s))
    if is_complete(number, layers.seen, team.claims):
        seen = layers.seen | {number}
        return replace(layers, seen=seen, choice=Choice(choice.top, since_s=now_s))
    return replace(layers, choice=replace(choice, examined=choice.examined | {number}))


def _go(layers: Layers, number: int, choice: Choice) -> Layers:
    """Goes on in a layer of the team, over the start."""
    return replace(layers, phase=LayersPhase.CLIMB, number=number, choice=choice)


def _is_begun(space: Occupancy) -> bool:
    """True if the space over the start is known in a layer."""
    cell = space.cell(START_NE_M)
    return space.has(cell) and bool(space.free[cell])


def _is_left(
    space: Occupancy, tried: tuple[Viewpoint, ...], observation: Observation, plan: MissionConfig
) -> bool:
    """True if a layer was not begun, or something in it can be reached from the start and seen."""
    if not _is_begun(space):
        return True
    ways = find_ways(find_ground(space, START_NE_M, clear_of_all_m(plan)))
    return any(not look.is_extra for look in looks(ways, observation, plan, tried))


def _above_layer_m(number: int, observation: Observation, plan: MissionConfig) -> float:
    """Room above the drone if it were at the height of a layer, m. It may still be below."""
    off_m = layer_height_m(number, plan) - observation.pose.height_m
    return observation.clear_m(Beam.UP) - off_m


def fits_above(above_m: float, number: int, plan: MissionConfig) -> bool:
    """True if the room above a drone in a layer, m, is enough for the next layer."""
    return _number_above(above_m, number, plan) > 0


def _number_above(above_m: float, number: int, plan: MissionConfig) -> int:
    """Number of layers that fit into the room above a layer, m; 1 if no ceiling is in range."""
    if math.isinf(above_m):
        fitting = 1
    else:
        room_m = above_m - plan.clearance_m - OVER_HEAD_M
        fitting = max(math.floor(room_m / plan.layer_spacing_m), 0)
    while fitting and layer_height_m(number + fitting, plan) > fence.top_m(plan):
        fitting -= 1
    return fitting


def _highest(
    choice: Choice | None, present: int, observation: Observation, plan: MissionConfig
) -> int:
    """The highest layer that fits above the start, over which the drone is in a layer."""
    now = present + _number_above(_above_layer_m(present, observation, plan), present, plan)
    return min(max(choice.top if choice else 0, now), MAX_LAYERS - 1)


def _climb(
    layers: Layers, observation: Observation, plan: MissionConfig
) -> tuple[Layers, Setpoint]:
    if abs(observation.pose.height_m - layers.height_m(plan)) >= AT_HEIGHT_M:
        return layers, stay(START_NE_M, observation.pose)
    team = observation.team_layers
    if team is None:
        return Layers.on(layers.number, layers.looked), HOLD
    if layers.choice is not None and layers.choice.is_all_seen(layers.seen):
        over = replace(layers.overfly, phase=OverflyPhase.CHOOSE)
        return replace(layers, phase=LayersPhase.OVERFLY, overfly=over), HOLD
    turns = not _is_begun(team.space(layers.number))
    return layers.exploring(turns=turns), HOLD
