"""Adds furniture that is hard to detect with beams: thin legs, poles, edges, ragged leaves.

A piece is built at its spot: width along x, back towards negative y. Heights are above the floor.
Furniture below the usual flight height of 1.2 m is present as in every room.

No part protrudes just below or above the level beams, where the hull would hit it but no beam would
detect it. A piece is lower than the hull, or has its outline or legs in its corners at beam height.
Shades and boards that protrude hang above the hull.
"""

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import shapely

from sitl.world.clutter.free_floor import FreeFloor
from sitl.world.clutter.pieces import ALONG_NORTH, Piece, Spot, any_direction, sheet, slab, turned
from sitl.world.clutter.standing import Face
from sitl.world.format import Walls, World

PER_M2 = 0.45
"""Pieces tried per m² of floor at difficulty 1. Chosen: half of it resembles a lived-in flat."""
TRIES = 8
"""Places tried for one piece."""
SQUARE_SHARE = 0.6
"""Share of the free-standing pieces that are aligned with north. Chosen."""
GAP_M = 0.03
"""Distance from a wall to a piece's back, m. Chosen: a skirting board."""
LEG_M = 0.03, 0.06
"""Minimum and maximum width of legs and posts, m. Chosen."""
POLE_M = 0.03, 0.08
"""Minimum and maximum width of poles, m. Chosen."""
BOARD_M = 0.03
"""Thickness of tops, seats and shelves, m."""
LOW_M, HIGH_M = 0.9, 1.35
"""Pieces end below or above these heights, m; the hull is from 1.0 to 1.4 m and drifts by 0.1 m."""
PROTRUDES_M = 1.5
"""Boards and shades that protrude begin above this height, m, or end below `LOW_M`: the hull ends
at 1.4 m and drifts by 0.1 m."""
MIN_ABOVE_M = 0.1
"""Smallest distance of a piece to the ceiling, m."""

Make = Callable[[Spot, random.Random, float], Piece]
"""Makes a piece at a spot, under a ceiling in m."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of furniture."""

    make: Make
    weight: float
    """Relative frequency. Chosen: about half of the pieces reach 1.2 m."""
    by_wall: bool = False


def furniture(
    world: World, faces: list[Face], floor: FreeFloor, difficulty: float, rng: random.Random
) -> Iterator[Piece]:
    """Furniture by the floor's area; each piece takes the first free place of its tries."""
    places = floor.places
    for _ in range(round(PER_M2 * difficulty * floor.area_m2)):
        [kind] = rng.choices(KINDS, [kind.weight for kind in KINDS])
        for _ in range(TRIES):
            if kind.by_wall and faces:
                spot = _at_wall(faces, rng)
            else:
                north, east = places[rng.randrange(len(places))].tolist()
                along = ALONG_NORTH if rng.random() < SQUARE_SHARE else any_direction(rng)
                spot = Spot((north, east), along)
            piece = kind.make(spot, rng, world.height_m - MIN_ABOVE_M)
            if floor.take(piece):
                yield piece
                break


def _at_wall(faces: list[Face], rng: random.Random) -> Spot:
    """Spot of a piece's back at a random wall, with its depth into the room."""
    [face] = rng.choices(faces, [face.length_m for face in faces])
    return face.spot.moved(rng.uniform(0.0, face.length_m), GAP_M)


def _legs(
    spot: Spot, width_m: float, depth_m: float, leg_m: float, top_m: float
) -> tuple[Walls, ...]:
    """Four legs in the corners of a rectangle."""
    x, y = (width_m - leg_m) / 2, (depth_m - leg_m) / 2
    return tuple(
        slab(spot.moved(a * x, b * y), leg_m, leg_m, 0.0, top_m) for a in (-1, 1) for b in (-1, 1)
    )


def _on_legs(
    spot: Spot, size_m: tuple[float, float], leg_m: float, height_m: float
) -> tuple[Walls, ...]:
    """Four legs with a top."""
    width_m, depth_m = size_m
    board = slab(spot, width_m, depth_m, height_m - BOARD_M, height_m)
    return (*_legs(spot, width_m, depth_m, leg_m, height_m - BOARD_M), board)


def _table(spot: Spot, rng: random.Random, ceiling_m: float) -> Piece:
    width_m, depth_m = rng.uniform(0.8, 1.6), rng.uniform(0.6, 0.9)
    walls = _on_legs(spot, (width_m, depth_m), rng.uniform(*LEG_M), rng.uniform(0.72, 0.76))
    return Piece(walls, spot.rectangle(width_m, depth_m))


def _high_table(spot: Spot, rng: random.Random, ceiling_m: float) -> Piece:
    """A bar table: its legs reach flight height, and the hull does not fit between them."""
    width_m, depth_m = rng.uniform(0.5, 0.6), rng.uniform(0.5, 0.6)
    walls = _on_legs(spot, (width_m, depth_m), rng.uniform(*LEG_M), rng.uniform(HIGH_M, 1.45))
    return Piece(walls, spot.rectangle(width_m, depth_m))


def _chair(spot: Spot, rng: random.Random, ceiling_m: float) -> Piece:
    """A chair; its back, two posts and a board, may be as high as a bar stool's."""
    side_m, leg_m = rng.uniform(0.38, 0.5), rng.uniform(0.03, 0.05)
    is_high = rng.random() < 0.4
    seat_m = rng.uniform(0.75, 0.85) if is_high else rng.uniform(0.43, 0.48)
    back_m = rng.uniform(HIGH_M, 1.45) if is_high else rng.uniform(0.8, LOW_M)
    y = (leg_m - side_m) / 2
    posts = tuple(
        slab(spot.moved(x * (side_m - leg_m) / 2, y), leg_m, leg_m, seat_m, back_m) for x in (-1, 1)
    )
    board = slab(spot.moved(0.0, y), side_m, BOARD_M, back_m - 0.2, back_m)
    walls = (*_on_legs(spot, (side_m, side_m), leg_m, seat_m), *posts, board)
    return Piece(walls, spot.rectangle(side_m, side_m))


def _rack(spot: Spot, rng: random.Random, ceiling_m: float) -> Piece:
    """Shelves on four posts, open on all sides, at a wall."""
    width_m, depth_m, post_m = rng.uniform(0.8, 1.6), rng.uniform(0.3, 0.45), rng.uniform(*LEG_M)
    top_m = min(rng.uniform(1.55, 2.0), ceiling_m)
    middle = spot.moved(0.0, depth_m / 2)
    count = rng.randint(3, 5)
    heights_m = (top_m * (n + 1) / count for n in range(count))
    boards = tuple(
        slab(middle, width_m, depth_m, height_m - BOARD_M, height_m)
        for height_m in heights_m
        if not LOW_M < height_m < PROTRUDES_M + BOARD_M
    )
    posts = _legs(middle, width_m, depth_m, post_m, top_m)
    return Piece((*posts, *boards), middle.rectangle(width_m, depth_m))


def _rail(spot: Spot, rng: random.Random, ceiling_m: float) -> Piece:
    """A clothes rail: two poles and a bar between, at a wall or not."""
    width_m, pole_m = rng.uniform(0.9, 1.5), rng.uniform(0.03, 0.04)
    top_m = min(rng.uniform(1.6, 1.9), ceiling_m)
    middle = spot.moved(0.0, 0.25)
    poles = tuple(
        slab(middle.moved(x * (width_m - pole_m) / 2, 0.0), pole_m, pole_m, 0.0, top_m)
        for x in (-1, 1)
    )
    bar = slab(middle, width_m, pole_m, top_m - pole_m, top_m)
    return Piece((*poles, bar), middle.rectangle(width_m, pole_m))


def _lamp(spot: Spot, rng: random.Random, ceiling_m: float) -> Piece:
    """A floor lamp: foot, pole, and a shade above flight height."""
    foot_m, pole_m = rng.uniform(0.25, 0.35), rng.uniform(0.03, 0.04)
    shade_m, shade_height_m = 0.3, 0.25
    top_m = min(rng.uniform(PROTRUDES_M + shade_height_m, 1.9), ceiling_m)
    shade_from_m = max(top_m - shade_height_m, PROTRUDES_M)
    walls = [
        slab(spot, foot_m, foot_m, 0.0, 0.03),
        slab(spot, pole_m, pole_m, 0.03, min(shade_from_m, top_m)),
    ]
    if top_m > shade_from_m:
        walls.append(slab(spot, shade_m, shade_m, shade_from_m, top_m))
    side_m = max(foot_m, shade_m)
    return Piece(tuple(walls), spot.rectangle(side_m, side_m))


def _pole(spot: Spot, rng: random.Random, ceiling_m: float) -> Piece:
    """A pole from the floor beyond flight height: a pipe, a post, a coat stand."""
    pole_m = rng.uniform(*POLE_M)
    top_m = min(rng.uniform(1.5, 2.4), ceiling_m)
    return Piece((slab(spot, pole_m, pole_m, 0.0, top_m),), spot.rectangle(pole_m, pole_m))


def _plant(spot: Spot, rng: random.Random, ceiling_m: float) -> Piece:
    """A ragged bush of 0.3 to 0.6 m with an opaque core, up to 2 m high."""
    radius_m, corners = rng.uniform(0.15, 0.3), rng.randint(7, 10)
    top_m = rng.uniform(0.6, LOW_M) if rng.random() < 0.4 else rng.uniform(HIGH_M, 2.0)
    top_m = min(top_m, ceiling_m)
    points = []
    for number in range(corners):
        # half a turn per unit of `share`; the half-angle tangent is almost linear in it
        share = 2 * (number + rng.uniform(0.0, 0.5)) / corners
        cos, sin = turned(2 * (share % 1.0) - 1)
        reach_m = rng.uniform(0.75, 1.0) * (radius_m if share < 1 else -radius_m)
        points.append(spot.at(cos * reach_m, sin * reach_m))
    core_m = 0.6 * radius_m
    walls = (
        sheet(points, 0.0, top_m, closed=True),
        slab(spot, core_m, core_m, 0.0, top_m),
    )
    return Piece(walls, shapely.Polygon(points))


def _partition(spot: Spot, rng: random.Random, ceiling_m: float) -> Piece:
    """A thin screen that stands out from a wall with its end in the open."""
    length_m, thick_m = rng.uniform(0.8, 2.0), rng.uniform(0.03, 0.05)
    top_m = min(rng.uniform(1.4, 2.0), ceiling_m)
    across = Spot(spot.at(0.0, length_m / 2), spot.across)
    return Piece(
        (slab(across, length_m, thick_m, 0.0, top_m),), across.rectangle(length_m, thick_m)
    )


KINDS = (
    Kind(_chair, 3.0),
    Kind(_table, 1.0),
    Kind(_high_table, 1.0),
    Kind(_rack, 1.5, by_wall=True),
    Kind(_rail, 0.7, by_wall=True),
    Kind(_lamp, 1.2),
    Kind(_pole, 1.5),
    Kind(_plant, 1.5),
    Kind(_partition, 1.0, by_wall=True),
    Kind(_partition, 0.5),
)
"""Kinds of furniture with their weights."""
