"""Adds doors to doorways: thin leaves, hinged at a jamb, open at any angle.

                 leaf                    free width
                  ╲  ⤶ angle      ≤ 90°: W · sin(angle)
    ═══════ jamb   hinge ════     > 90°: W

The leaf's inner face turns about the jamb's corner. Opened to a right angle, it does not narrow the
doorway.
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
"""Thickness of a leaf, m, as of interior doors."""
SLIT_M = 0.02
"""A leaf is narrower than its doorway by this, m."""
FROM_HINGE_M = 0.06
"""Start of a leaf's footprint from the jamb it touches, m. Chosen: its thickness and a gap."""
DOOR_WIDTHS_M = 0.6, 1.5
"""Width of doorways with a leaf, m. Chosen: narrower ones are hatches, wider ones passages."""
LINTEL_M = 1.7
"""A wall with its lower edge above this is a lintel, m. Chosen: a low door's height."""
MIN_WIDTH_M = 0.8
"""Free width beside a leaf, m, for the drone; not in narrower doorways."""
WITH_LEAF_SHARE = 0.9
"""Share of doorways with a leaf, from difficulty 0.5 on. Chosen."""
SHUT_SHARE = 0.2
"""Share of shut leaves at difficulty 1; none up to 0.5. Chosen."""
OPEN = 0.577, 1.732
"""Tangent of the half angle of open leaves: 60 to 120 degrees."""
PARTLY = 0.364, 0.577
"""Tangent of the half angle of partly open leaves: 40 to 60 degrees."""
SHUT = 0.044, 0.176
"""Tangent of the half angle of shut leaves: 5 to 20 degrees, a slit for a beam."""
STEP_M = 0.3
"""Free distance from a doorway's middle to either side, m. Chosen."""
PARTLY_SHARE = 0.25
"""Share of partly open leaves, where the doorway is wide enough. Chosen."""
TRIES = 6
"""Angles and hinges tried for one leaf."""


@dataclass(frozen=True, slots=True)
class Doorway:
    """An opening for a door; `spot` is its middle, along the wall."""

    spot: Spot
    width_m: float
    thickness_m: float
    height_m: float


def leaves(
    doorways: Iterable[Doorway], floor: FreeFloor, difficulty: float, rng: random.Random
) -> Iterator[Piece]:
    """Leaves for most of the doorways; from difficulty 0.5 on for `WITH_LEAF_SHARE` of them."""
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
    """Doorways with a lintel and no sill. Openings of maps reach the ceiling and have no lintel."""
    under = [_below(panel) for panel in world.panels if panel.bottom_m >= LINTEL_M]
    least_m, most_m = DOOR_WIDTHS_M
    return [
        doorway
        for doorway in under
        if least_m <= doorway.width_m <= most_m
        and floor.is_clear(doorway.spot.at(0.0, -STEP_M), doorway.spot.at(0.0, STEP_M))
    ]


def _below(panel: Panel) -> Doorway:
    """The doorway under a lintel."""
    (north, east), (to_north, to_east) = panel.start, panel.end
    length_m = dist(panel.start, panel.end)
    along = (to_north - north) / length_m, (to_east - east) / length_m
    middle = (north + to_north) / 2, (east + to_east) / 2
    return Doorway(Spot(middle, along), length_m, panel.thickness_m, panel.bottom_m)


def _is_wide_enough(width_m: float, half_tangent: float) -> bool:
    """The opening stays passable, and one that counts as a door for the scores stays one."""
    cos, sin = turned(half_tangent)
    free_m = width_m * sin if cos > 0 else width_m
    needed_m = NARROWEST_DOOR_M if width_m >= NARROWEST_DOOR_M else MIN_WIDTH_M
    return free_m >= min(needed_m, width_m)


def _leaf(doorway: Doorway, half_tangent: float, rng: random.Random) -> Piece:
    """A leaf hinged at a random jamb, open to a random side."""
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
