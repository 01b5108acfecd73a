"""Adds clutter at walls: protruding cells, as in maps of robots, and curtains."""

import random
from collections.abc import Callable, Iterator

from sitl.world.clutter.free_floor import FreeFloor
from sitl.world.clutter.pieces import Piece, Spot, sheet, slab
from sitl.world.clutter.standing import ASIDE_M, OFF_WALL_M, Face, length_of
from sitl.world.format import Walls

CELL_M = 0.05
"""Cell size of most robots' maps, m."""
JAG_CELLS = 1, 8
"""Width of a jag along the wall, cells."""
JAG_DEPTH_CELLS = 1, 2
"""Depth of a jag, cells."""
JAGGED_SHARE = 0.25
"""Share of the walls' length with jags at difficulty 1. Chosen."""
JAG_TOP_M = 2.0
"""Height limit of jags, m. Chosen: objects at walls are seldom higher."""

CURTAIN_M = 0.8, 2.4
"""Length of a curtain, m: a window's width."""
CURTAIN_OFF_M = 0.06, 0.15
"""Distance from the wall to the middle of the folds, m: a rail's distance."""
FOLD_M = 0.02, 0.05
"""Amplitude of a fold, m."""
FOLD_STEP_M = 0.05
"""A quarter of a fold along the wall, m."""
FOLDS = (0.0, 1.0, 0.0, -1.0)
"""Offsets of successive points of a fold, times its amplitude."""
CURTAIN_BOTTOM_M = 0.0, 0.3
"""Minimum and maximum height of a curtain's bottom, m; no lower than that of its wall. Chosen."""
CURTAIN_TOP_M = 2.2
"""Top of a curtain, m, limited by the ceiling."""
CURTAINED_SHARE = 0.15
"""Share of the walls' length with curtains at difficulty 1. Chosen: a window or two in a room."""

CORNER_M = 0.05
"""Distance from a wall's end to a piece before it, m. Chosen."""


def jags(
    faces: list[Face], floor: FreeFloor, difficulty: float, rng: random.Random
) -> Iterator[Piece]:
    """Short stretches that protrude 5 or 10 cm from the walls."""
    mean_m = CELL_M * sum(JAG_CELLS) / 2
    wanted = round(JAGGED_SHARE * difficulty * length_of(faces) / mean_m)
    yield from _along(faces, floor, wanted, rng, _jag)


def curtains(
    faces: list[Face], floor: FreeFloor, difficulty: float, rng: random.Random
) -> Iterator[Piece]:
    """Wavy surfaces a few centimetres before the walls."""
    wanted = round(CURTAINED_SHARE * difficulty * length_of(faces) / (sum(CURTAIN_M) / 2))
    yield from _along(faces, floor, wanted, rng, _curtain)


def _along(
    faces: list[Face],
    floor: FreeFloor,
    wanted: int,
    rng: random.Random,
    make: Callable[[Face, random.Random], Piece | None],
) -> Iterator[Piece]:
    """Try `wanted` pieces once each."""
    for _ in range(wanted):
        [face] = rng.choices(faces, [face.length_m for face in faces])
        piece = make(face, rng)
        if piece is not None and floor.take(piece):
            yield piece


def _jag(face: Face, rng: random.Random) -> Piece | None:
    width_m = CELL_M * rng.randint(*JAG_CELLS)
    depth_m = CELL_M * rng.randint(*JAG_DEPTH_CELLS)
    spot = _before(face, width_m, rng)
    if spot is None:
        return None
    top_m = min(face.top_m, JAG_TOP_M)
    stone = slab(spot.moved(0.0, depth_m / 2), width_m, depth_m, face.bottom_m, top_m)
    return _piece(spot, width_m, depth_m, stone)


def _curtain(face: Face, rng: random.Random) -> Piece | None:
    quarters = round(rng.uniform(*CURTAIN_M) / FOLD_STEP_M)
    width_m, fold_m = FOLD_STEP_M * quarters, rng.uniform(*FOLD_M)
    off_m = max(rng.uniform(*CURTAIN_OFF_M), fold_m + OFF_WALL_M)
    bottom_m = max(face.bottom_m, rng.uniform(*CURTAIN_BOTTOM_M))
    spot = _before(face, width_m, rng)
    if spot is None:
        return None
    points = (
        spot.at(FOLD_STEP_M * n - width_m / 2, off_m + fold_m * FOLDS[n % len(FOLDS)])
        for n in range(quarters + 1)
    )
    cloth = sheet(points, bottom_m, min(face.top_m, CURTAIN_TOP_M), closed=False)
    return _piece(spot, width_m, off_m + fold_m, cloth)


def _before(face: Face, width_m: float, rng: random.Random) -> Spot | None:
    """A random place on a face for a piece of this width; None if the face is too short."""
    slack_m = face.length_m - width_m - 2 * CORNER_M
    if slack_m < 0:
        return None
    return face.spot.moved(CORNER_M + width_m / 2 + rng.uniform(0.0, slack_m), 0.0)


def _piece(spot: Spot, width_m: float, depth_m: float, wall: Walls) -> Piece:
    """A piece at a wall; its footprint excludes the wall."""
    deep_m = max(depth_m, OFF_WALL_M + CELL_M)
    footprint = spot.moved(0.0, (OFF_WALL_M + deep_m) / 2).rectangle(width_m, deep_m - OFF_WALL_M)
    return Piece((wall,), footprint, anchor=spot.at(0.0, ASIDE_M))
