"""Doors in the doorways of a world: thin leaves, hinged at a jamb, that stand open at any angle.

                 leaf                    free width
                  ╲  ⤶ angle      ≤ 90°: W · sin(angle)
    ═══════ jamb   hinge ════     > 90°: W

The leaf's inner face turns about the jamb's corner, so what is open at a right angle takes nothing
from the doorway.
"""

import random
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import dist

from sitl.world.clutter.free_floor import FreeFloor
from sitl.world.clutter.pieces import Piece, Spot, slab, turned
from sitl.world.format import Panel, World
from sitl.world.plan import NARROWEST_DOOR_M

LEAF_M = 0.04
"""Thick, as doors of rooms are."""
SLIT_M = 0.02
"""A leaf is so much narrower than its doorway."""
FROM_HINGE_M = 0.06
"""Its footprint begins so far from the jamb that it touches; chosen, its thickness and a gap."""
DOOR_WIDTHS_M = 0.6, 1.5
"""What has a leaf: narrower are hatches, wider are passages; chosen."""
LINTEL_M = 1.7
"""A wall with its lower edge above this is over a doorway; chosen, a low door's height."""
MIN_WIDTH_M = 0.8
"""Free beside a leaf, unless the doorway was narrower; for the drone to get through."""
WITH_LEAF_SHARE = 0.9
"""Of the doorways, from difficulty 0.5 on; chosen."""
SHUT_SHARE = 0.2
"""Of the leaves, at difficulty 1; none up to 0.5. Chosen."""
OPEN = 0.577, 1.732
"""Tangents of half the angle, from 60 to 120 degrees."""
PARTLY = 0.364, 0.577
"""From 40 to 60 degrees."""
SHUT = 0.044, 0.176
"""From 5 to 20 degrees: a slit to see through."""
STEP_M = 0.3
"""From a doorway's middle to either side: so far at least nothing stands in it; chosen."""
PARTLY_SHARE = 0.25
"""Of the leaves, where the doorway is wide enough; chosen."""
TRIES = 6
"""Of angles and hinges, for one leaf."""


@dataclass(frozen=True, slots=True)
class Doorway:
    """`spot` is the middle of it, along the wall."""

    spot: Spot
    width_m: float
    thickness_m: float
    height_m: float


def leaves(
    doorways: Iterable[Doorway], floor: FreeFloor, difficulty: float, rng: random.Random
) -> Iterator[Piece]:
    """For most of the doorways, from difficulty 0.5 on."""
    with_leaf = WITH_LEAF_SHARE * min(1.0, 2 * difficulty)
    shut = SHUT_SHARE * max(0.0, 2 * difficulty - 1)
    for doorway in doorways:
        if rng.random() >= with_leaf:
            continue
        is_shut = rng.random() < shut
        for _ in range(TRIES):
            if is_shut:
                half_tangent = rng.uniform(*SHUT)
            else:
                half_tangent = rng.uniform(*(PARTLY if rng.random() < PARTLY_SHARE else OPEN))
                if not _is_wide_enough(doorway.width_m, half_tangent):
                    continue
            piece = _leaf(doorway, half_tangent, rng)
            if floor.shut(piece) if is_shut else floor.take(piece):
                yield piece
                break


def doorways_of(world: World, floor: FreeFloor) -> list[Doorway]:
    """Those that have a lintel and no sill; a map's openings up to the ceiling have none."""
    under = [_below(panel) for panel in world.panels if panel.bottom_m >= LINTEL_M]
    least_m, most_m = DOOR_WIDTHS_M
    return [
        doorway
        for doorway in under
        if least_m <= doorway.width_m <= most_m
        and floor.is_clear(doorway.spot.at(0.0, -STEP_M), doorway.spot.at(0.0, STEP_M))
    ]


def _below(panel: Panel) -> Doorway:
    """A lintel."""
    (north, east), (to_north, to_east) = panel.start, panel.end
    length_m = dist(panel.start, panel.end)
    along = (to_north - north) / length_m, (to_east - east) / length_m
    middle = (north + to_north) / 2, (east + to_east) / 2
    return Doorway(Spot(middle, along), length_m, panel.thickness_m, panel.bottom_m)


def _is_wide_enough(width_m: float, half_tangent: float) -> bool:
    """What could be entered can be still, and so can what the score counts as a door."""
    cos, sin = turned(half_tangent)
    free_m = width_m * sin if cos > 0 else width_m
    needed_m = NARROWEST_DOOR_M if width_m >= NARROWEST_DOOR_M else MIN_WIDTH_M
    return free_m >= min(needed_m, width_m)


def _leaf(doorway: Doorway, half_tangent: float, rng: random.Random) -> Piece:
    """Hinged at either jamb, to either side."""
    cos, sin = turned(half_tangent)
    spot = doorway.spot
    if rng.random() < 0.5:  # into the other room
        spot = Spot(spot.place, (-spot.along[0], -spot.along[1]))
    hand = -1.0 if rng.random() < 0.5 else 1.0
    # in x and y: hinge (∓W/2, T/2), the leaf's direction (±cos, sin), its outer side (∓sin, cos)
    hinge = spot.at(hand * -doorway.width_m / 2, doorway.thickness_m / 2)
    (u_n, u_e), (v_n, v_e) = spot.along, spot.across
    along = hand * cos * u_n + sin * v_n, hand * cos * u_e + sin * v_e
    out = hand * -sin * u_n + cos * v_n, hand * -sin * u_e + cos * v_e
    middle_line = (
        hinge[0] + LEAF_M / 2 * out[0],
        hinge[1] + LEAF_M / 2 * out[1],
    )
    leaf = Spot(middle_line, along)
    width_m = doorway.width_m - SLIT_M
    board = slab(leaf.moved(width_m / 2, 0.0), width_m, LEAF_M, 0.0, doorway.height_m)
    clear_m = width_m - FROM_HINGE_M
    footprint = leaf.moved(FROM_HINGE_M + clear_m / 2, 0.0).rectangle(clear_m, LEAF_M)
    return Piece((board,), footprint)
