"""Divides the layers between the drones of a team, without a leader.

    layer 3   2 ▼             first: the first drone takes the lowest layer, the second the highest,
    layer 2    ...  3         and others the lowest ones that are left
    layer 1   3 ▲             then:  the nearest layer that nobody has; if there is none, one in
    layer 0   1 ▲                    which teammates still find something

A drone tells in which layer it is, and which layers were seen. A layer was seen when nothing is
left on the joined map, and all layers below were seen: what is free in a layer may open more above.
A drone that lands, flies home or falls silent has no layer. Then others take over what is left.
"""

import math

from companion.config.settings import MissionConfig
from companion.config.team import MAX_LAYERS
from companion.core.messages import Beam
from companion.core.values import value
from companion.mapping.occupancy import Occupancy
from companion.navigation.grid_planner import START_NE_M, find_ground, find_ways
from companion.navigation.observation import LayerClaim, Observation
from companion.pdps.viewpoints import Viewpoint, looks
from companion.safety.velocity_guard import clear_of_all_m

AGAIN_S = 2.0
"""Time of waiting before the layers are examined again, s. Chosen."""
OVER_HEAD_M = 0.25
"""Margin between the drone's centre and the ceiling, beyond the clearance, m. Chosen."""


@value
class Choice:
    """State of the choice of a layer."""

    top: int = 0
    """The highest layer that fits above the start."""
    examined: frozenset[int] = frozenset()
    """Layers in which nothing was left at this moment."""
    since_s: float = -math.inf
    """Time since which the layers are examined, s."""

    def is_all_seen(self, seen: frozenset[int]) -> bool:
        """True if all layers above the start were seen."""
        return seen.issuperset(range(self.top + 1))


def first(present: int, top: int, claims: tuple[LayerClaim, ...]) -> int:
    """The layer with which a drone begins."""
    order = dict.fromkeys((0, top, *range(1, top)))
    others = {claim.number for claim in claims if claim.number != present}
    free = [number for number in order if number not in others]
    before = sum(claim.comes_first and claim.number == present for claim in claims)
    return free[min(before, len(free) - 1)] if free else present


def wanted(
    choice: Choice, present: int, seen: frozenset[int], claims: tuple[LayerClaim, ...]
) -> list[int]:
    """Layers to examine, the best first: not those that were seen, or have been examined."""
    left = set(range(choice.top + 1)) - seen - choice.examined
    return sorted(
        left,
        key=lambda number: (_is_claimed(number, present, claims), abs(number - present), number),
    )


def is_complete(number: int, seen: frozenset[int], claims: tuple[LayerClaim, ...]) -> bool:
    """True if a layer in which nothing is left was seen: no teammate is there, or below."""
    is_free = all(claim.number != number for claim in claims)
    return is_free and seen.issuperset(range(number))


def _is_claimed(number: int, present: int, claims: tuple[LayerClaim, ...]) -> bool:
    """True if a layer is a teammate's. Of two drones in one layer, the first has it."""
    return any(
        claim.number == number and (claim.comes_first or number != present) for claim in claims
    )


def is_begun(space: Occupancy) -> bool:
    """True if the space over the start is known in a layer."""
    cell = space.cell(START_NE_M)
    return space.has(cell) and bool(space.free[cell])


def is_left(
    space: Occupancy, tried: tuple[Viewpoint, ...], observation: Observation, plan: MissionConfig
) -> bool:
    """True if a layer was not begun, or something in it can be reached from the start and seen."""
    if not is_begun(space):
        return True
    ways = find_ways(find_ground(space, START_NE_M, clear_of_all_m(plan)))
    return any(not look.is_extra for look in looks(ways, observation, plan, tried))


def layer_height_m(number: int, plan: MissionConfig) -> float:
    """Height of a layer, m."""
    return plan.height_m + number * plan.layer_spacing_m


def fits_above(above_m: float, plan: MissionConfig) -> bool:
    """True if the room above the drone, m, is enough for the next layer."""
    return number_above(above_m, plan) > 0


def number_above(above_m: float, plan: MissionConfig) -> int:
    """Number of layers that fit into the room above the drone, m; 1 if no ceiling is in range."""
    if math.isinf(above_m):
        return 1
    room_m = above_m - plan.clearance_m - OVER_HEAD_M
    return max(math.floor(room_m / plan.layer_spacing_m), 0)


def highest(
    choice: Choice | None, present: int, observation: Observation, plan: MissionConfig
) -> int:
    """The highest layer that fits above the start, over which the drone is in a layer."""
    now = present + number_above(observation.clear_m(Beam.UP), plan)
    return min(max(choice.top if choice else 0, now), MAX_LAYERS - 1)
