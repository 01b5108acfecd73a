"""Rooms in files of several formats, and their imported plans, for tests of the importers."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.path import Path as Outline
from numpy.typing import NDArray
from PIL import Image

from companion.core.arrays import Array, Mask
from sitl.world.format import World, WorldError
from sitl.world.loading import load_world
from sitl.world.plan import wall_surfaces
from tests.maps import CELL_M, FREE, UNKNOWN, WALL

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


def refused(path: Path | str) -> str:
    """The reason why a file is refused, in one line."""
    with pytest.raises(WorldError) as error:
        load_world(str(path))
    message = str(error.value)
    assert "\n" not in message
    return message


def refusal(path: Path) -> str:
    """The reason why a file is refused, which names the file."""
    message = refused(path)
    assert path.name in message
    return message


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


# A ROS map

WALL_M = 0.15
Picture = NDArray[np.uint8]

MAP = {
    "image": "house.pgm",
    "resolution": CELL_M,
    "origin": [0.0, 0.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def write_map(folder: Path, picture: Image.Image, **changes: object) -> str:
    record = {**MAP, **changes}
    picture.save(folder / str(record["image"]))
    path = folder / "house.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in record.items() if v is not None}))
    return str(path)


def outside(corners: Array) -> Array:
    """Corners of the walls' outer face; the room has right angles and anticlockwise corners."""
    along = np.roll(corners, -1, axis=0) - corners
    out = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    outer: Array = corners + WALL_M * (out + np.roll(out, 1, axis=0))
    return outer


def is_within(corners: Array, shape: tuple[int, int]) -> Mask:
    """Mask of the cells whose centre is in the polygon (x, y); rows from the top."""
    y, x = (np.indices(shape) + 0.5) * CELL_M
    inside = Outline(corners).contains_points(np.column_stack([x.ravel(), y.ravel()]))
    return np.flipud(inside.reshape(shape))


def rasterise(corners: Array) -> Picture:
    """A map of a room with these corners (x, y) and walls; the lower left cell is at (0, 0)."""
    columns, rows = np.ceil((corners.max(axis=0) + 1) / CELL_M).astype(int).tolist()
    wall, room = (is_within(c, (rows, columns)) for c in (outside(corners), corners))
    return np.where(room, FREE, np.where(wall, WALL, UNKNOWN)).astype(np.uint8)


SQUARE = rasterise(np.array([(1.0, 1.0), (5.0, 1.0), (5.0, 4.0), (1.0, 4.0)]))
