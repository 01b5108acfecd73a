"""Divides viewpoints and layers between the drones of a team, without a leader.

**Viewpoints.** A drone tells its teammates what it goes to look at, and when it will be there. A
viewpoint whose targets a teammate sees sooner is left to it. Of two drones that are equally soon,
the first by number goes. All decide by the same rule. Round a building, a drone goes to the
viewpoints on its side that is turned away from its teammates, as long as there are any. So two
drones go round opposite ways, until they meet at its far side. Where a team flies over everything,
each takes what it reaches sooner than all that are on their way.

**Layers.** A drone tells in which layer it is, and which layers were seen.

    layer 3   2 ▼             first: the first drone takes the lowest layer, the second the highest,
    layer 2                   and others the lowest ones that are left
    layer 1   3 ▲             then:  the nearest layer that nobody has; if there is none, one in
    layer 0   1 ▲                    which teammates still find something

A layer was seen when nothing is left on the joined map, and all layers below were seen: what is
free in a layer may open more above. A drone that lands, flies home or falls silent has no layer.
Then others take over what is left.
"""

import math
from dataclasses import replace

import numpy as np

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector2, to_nearest_m
from companion.core.values import value
from companion.navigation.grid_planner import ShortestPaths, find_ways
from companion.navigation.observation import Claim, LayerClaim
from companion.pdps.viewpoints import Viewpoint

SAME_M = 1.0
"""A target is the same as a teammate's within this distance, m. Chosen: the error of the alignment,
and of the targets on two maps."""
SAME_SHARE = 0.5
"""A viewpoint with more than this share of its targets claimed is claimed. Chosen."""
EQUALLY_SOON_S = 2.0
"""Two drones are equally soon within this time, s. Chosen."""
OWN_SIDE_SHARE = 0.1
"""A drone may turn back for a viewpoint by half of this share of its distance to the nearest
teammate. Chosen: little at the begin, when the drones are near each other, and 2 m later."""


def is_claimed(look: Viewpoint, arrives_in_s: float, claims: tuple[Claim, ...]) -> bool:
    """True if a teammate sees the targets of a viewpoint sooner than this drone."""
    return any(_is_same(look, claim) and _is_sooner(claim, arrives_in_s) for claim in claims)


def is_more_expected(claims: tuple[Claim, ...]) -> bool:
    """True if a teammate looks at something that may open more space."""
    return any(not claim.is_extra for claim in claims)


def on_own_side(
    looks: tuple[Viewpoint, ...], ways: ShortestPaths, others_ne_m: tuple[Vector2, ...]
) -> tuple[Viewpoint, ...]:
    """The viewpoints on the side of this drone that is turned away from its teammates.

    To those the nearest teammate's path leads past this drone, so it is longer than the own one by
    the distance between both. `ways` are the paths of this drone, to all viewpoints.
    """
    start = ways.ground.start
    paths = (_metres_from(place, ways) for place in others_ne_m)
    theirs = [metres for metres in paths if math.isfinite(metres[start])]
    if not theirs:
        return looks
    cells = tuple(np.array([ways.ground.grid.cell(look.from_ne_m) for look in looks]).T)
    apart_m = min(float(metres[start]) for metres in theirs)
    ahead_m = np.min([metres[cells] for metres in theirs], axis=0) - ways.metres[cells]
    is_own = ahead_m >= ahead_m.max() - OWN_SIDE_SHARE * apart_m
    return tuple(look for look, own in zip(looks, is_own.tolist(), strict=True) if own)


def sooner_reached(left: Mask, ways: ShortestPaths, claims: tuple[Claim, ...]) -> Mask:
    """The masked cells that no teammate with a claim reaches sooner than this drone."""
    own = left.copy()
    for claim in claims:
        own &= ways.metres <= _metres_from(claim.from_ne_m, ways)
    return own


def _metres_from(place_ne_m: Vector2, ways: ShortestPaths) -> Array:
    """Cost of the path to each cell from the passable cell that is nearest to a place."""
    passable = np.argwhere(ways.ground.passable)
    off = np.abs(passable - np.array(ways.ground.grid.cell(place_ne_m)))
    row, column = passable[int(off.sum(axis=1).argmin())].tolist()
    return find_ways(replace(ways.ground, start=(row, column))).metres


def _is_same(look: Viewpoint, claim: Claim) -> bool:
    apart_m = to_nearest_m(np.array(look.at_ne_m), np.array(claim.places_ne_m))
    return float((apart_m < SAME_M).mean()) > SAME_SHARE


def _is_sooner(claim: Claim, arrives_in_s: float) -> bool:
    ahead_s = arrives_in_s - claim.arrives_in_s
    return ahead_s > EQUALLY_SOON_S or (claim.comes_first and ahead_s >= -EQUALLY_SOON_S)


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


def first_layer(present: int, top: int, claims: tuple[LayerClaim, ...]) -> int:
    """The layer with which a drone begins."""
    order = dict.fromkeys((0, top, *range(1, top)))
    others = {claim.number for claim in claims if claim.number != present}
    free = [number for number in order if number not in others]
    before = sum(claim.comes_first and claim.number == present for claim in claims)
    return free[min(before, len(free) - 1)] if free else present


def wanted_layers(
    choice: Choice, present: int, seen: frozenset[int], claims: tuple[LayerClaim, ...]
) -> list[int]:
    """Layers to examine, the best first: not those that were seen, or have been examined."""
    left = set(range(choice.top + 1)) - seen - choice.examined
    return sorted(
        left,
        key=lambda number: (
            is_others_layer(number, present, claims),
            abs(number - present),
            number,
        ),
    )


def is_complete(number: int, seen: frozenset[int], claims: tuple[LayerClaim, ...]) -> bool:
    """True if a layer in which nothing is left was seen: no teammate is there, or below."""
    is_free = all(claim.number != number for claim in claims)
    return is_free and seen.issuperset(range(number))


def is_others_layer(number: int, present: int, claims: tuple[LayerClaim, ...]) -> bool:
    """True if a layer is a teammate's. Of two drones in one layer, the first has it."""
    return any(
        claim.number == number and (claim.comes_first or number != present) for claim in claims
    )
