"""Rooms in files of several formats, and their imported plans, for tests of the importers."""

import math
from collections.abc import Sequence
from pathlib import Path

import pytest

from sitl.world.format import World, WorldError
from sitl.world.loading import load_world
from sitl.world.plan import wall_surfaces

Wall = tuple[float, float, float, float]
"""A wall from (x, y) to (x, y), m; x is east, y is north."""

OUTER: list[Wall] = [(0, 0, 8, 0), (8, 0, 8, 5), (8, 5, 0, 5), (0, 5, 0, 0)]
PARTITIONS: list[Wall] = [(4, 0, 4, 3), (4, 3, 6, 3)]
ROOM = OUTER + PARTITIONS
HEIGHT_M = 2.6
LENGTH_M = sum(math.dist(wall[:2], wall[2:]) for wall in ROOM)


def corners(wall: Wall) -> list[tuple[float, float, float]]:
    xa, ya, xb, yb = wall
    return [(xa, ya, 0), (xb, yb, 0), (xb, yb, HEIGHT_M), (xa, ya, HEIGHT_M)]


def plan(world: World) -> list[tuple[float, ...]]:
    """Sorted ends of all wall surfaces at a height of 1.2 m."""
    return sorted(
        tuple(round(float(x), 2) + 0.0 for end in sorted(line) for x in end)
        for line in wall_surfaces(world, 1.2)
    )


def length_m(world: World) -> float:
    return sum(math.dist(*line) for line in wall_surfaces(world, 1.2))


def refusal(path: Path) -> str:
    with pytest.raises(WorldError) as refused:
        load_world(str(path))
    assert "\n" not in str(refused.value)
    assert path.name in str(refused.value)
    return str(refused.value)


def obj(groups: Sequence[Sequence[Wall]], *, back: bool, slashes: str = "") -> str:
    """OBJ text: each group's vertices, then its faces, with relative indices if `back`."""
    lines, seen = [], 0
    for group in groups:
        lines += [f"v {x} {y} {z}" for wall in group for x, y, z in corners(wall)]
        seen += 4 * len(group)
        for number in range(len(group)):
            first = 4 * number - 4 * len(group) if back else seen + 4 * number - 4 * len(group) + 1
            lines.append("f " + " ".join(f"{first + i}{slashes}" for i in range(4)))
    return "\n".join(lines) + "\n"


ABSOLUTE = obj([ROOM], back=False)
