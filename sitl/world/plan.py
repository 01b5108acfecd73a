"""Computes the true walls at one height, seen from above, and which of them are observable."""

import math
from collections import deque

import numpy as np
from scipy.spatial import cKDTree

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2
from sitl.world.format import Segment, World
from sitl.world.geometry.model import WorldModel

SAMPLE_M = 0.05
"""Distance of the samples along walls, m."""
CELL_M = 0.15
"""Cell of the grid on which reachable places are searched, m. Chosen."""
NARROWEST_DOOR_M = 0.9
"""The drone need not pass narrower openings, m: they are marked, not entered."""
OUTSIDE_M = 1.0
"""Search margin around the world, m: the drone may fly around it once. Chosen."""
SEEN_FROM_M = 1.5
"""A wall is observable if the drone can hover within this distance with a line of sight, m."""
CLEAR_OF_SAMPLE_M = 0.03
"""Lines of sight end this far before the sample, m, so that its own wall does not block them."""
MAX_VIEWPOINTS = 60
"""Reachable places tried for each sample. Chosen."""
VIEWPOINTS_AT_ONCE = slice(4), slice(4, 16), slice(16, MAX_VIEWPOINTS)
"""Batches of places, nearest first: most samples are visible from the first batch."""
BLOCK_M = 0.5
"""Side of the squares whose samples are checked together, m. Chosen."""
MAX_PAIRS = 100_000
"""Pairs of line of sight and wall in one batch: some ten MB. Chosen."""


def wall_surfaces(world: World, height_m: float, *, with_glass: bool = False) -> list[Segment]:
    """Segments, (north, east) in m, of all visible surfaces at this height."""
    surfaces: list[Segment] = []
    for panel in world.panels:
        if panel.bottom_m <= height_m <= panel.top_m and (with_glass or not panel.glass):
            surfaces += panel.outline
    for box in world.boxes:
        if box.bottom_m <= height_m <= box.top_m:
            surfaces += box.segments
    if world.mesh is not None:
        surfaces += world.mesh.section(height_m)
    return surfaces


def samples(segments: list[Segment]) -> Array:
    """Points every 5 cm along the segments, (n, 2), m."""
    return spread(np.array(segments, dtype=float).reshape(-1, 2, 2))[0]


def spread(segments: Array) -> tuple[Array, Indices]:
    """Points (n, 2) every 5 cm along segments (m, 2, 2), and each point's segment number."""
    length_m = [math.dist(start, end) for start, end in segments.tolist()]
    count = np.maximum(1, np.round(np.array(length_m) / SAMPLE_M)).astype(np.int64)
    segment = np.repeat(np.arange(len(segments)), count)
    first = np.repeat(count.cumsum() - count, count)
    share = ((np.arange(len(segment)) - first + 0.5) / count[segment])[:, None]
    return (1 - share) * segments[segment, 0] + share * segments[segment, 1], segment


def observable_points(world: World, height_m: float, start: Vector2) -> Array:
    """Samples of the surfaces that a drone from this start could approach and see, (n, 2)."""
    surfaces = wall_surfaces(world, height_m)
    reached = cKDTree(reachable(world, height_m, start))
    walls = np.array([*surfaces, *world.closed_border], dtype=float).reshape(-1, 2, 2)
    points = samples(surfaces)
    seen = np.zeros(len(points), dtype=bool)
    for block in _blocks(points):
        seen[block] = _are_seen(points[block], reached, walls)
    visible: Array = points[seen]
    return visible


def reachable(world: World, height_m: float, start: Vector2) -> Array:
    """Cell centres reachable through doors at this height, (n, 2), m."""
    model, half_door_m = WorldModel(world), NARROWEST_DOOR_M / 2 - CELL_M / 2
    (south, west), (north, east) = _bounds_with(world, start)
    waiting = deque([(0, 0)])
    free = {(0, 0)}
    while waiting:
        row, column = waiting.popleft()
        for cell in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            place = (start[0] + cell[0] * CELL_M, start[1] + cell[1] * CELL_M, -height_m)
            inside = (
                south - OUTSIDE_M < place[0] < north + OUTSIDE_M
                and west - OUTSIDE_M < place[1] < east + OUTSIDE_M
            )
            if inside and cell not in free and model.clearance_m(place) > half_door_m:
                free.add(cell)
                waiting.append(cell)
    return np.array(start) + CELL_M * np.array(sorted(free), dtype=float)


def _bounds_with(world: World, start: Vector2) -> tuple[Vector2, Vector2]:
    """Bounds of the world and of a start that may lie outside."""
    low, high = world.bounds
    return (
        (min(low[0], start[0]), min(low[1], start[1])),
        (max(high[0], start[0]), max(high[1], start[1])),
    )


def _blocks(points: Array) -> list[Indices]:
    """Numbers of the points, grouped by square: points of a square share the walls near them."""
    square = np.floor(points / BLOCK_M).astype(np.int64)
    _, block = np.unique(square, axis=0, return_inverse=True)
    order = np.argsort(block.reshape(-1), kind="stable")
    return np.split(order, np.bincount(block.reshape(-1)).cumsum()[:-1])


def _are_seen(points: Array, tree: cKDTree, walls: Array) -> Mask:
    """Each point has a clear line of sight from one of the nearest reachable places, (n,)."""
    walls = walls[_are_near(walls, points.min(axis=0), points.max(axis=0))]
    near = _are_near(walls, points[:, None], points[:, None])
    distance, place = tree.query(points, k=MAX_VIEWPOINTS, distance_upper_bound=SEEN_FROM_M)
    seen = np.zeros(len(points), dtype=bool)
    for few in VIEWPOINTS_AT_ONCE:
        point, eye = np.nonzero(np.isfinite(distance[:, few]) & ~seen[:, None])
        eyes = tree.data[place[:, few][point, eye]]
        for rows in _parts(len(eyes), len(walls)):
            clear = _has_sight(points[point[rows]], eyes[rows], walls, near[point[rows]])
            seen[point[rows][clear]] = True
    return seen


def _are_near(walls: Array, low: Array, high: Array) -> Mask:
    """Walls (m, 2, 2) within viewing distance of the rectangle between two corners."""
    reach = (walls.min(axis=1) <= high + SEEN_FROM_M) & (walls.max(axis=1) >= low - SEEN_FROM_M)
    near: Mask = reach.all(axis=-1)
    return near


def _parts(lines: int, walls: int) -> list[slice]:
    """Batches of lines of sight that limit the memory."""
    step = max(1, MAX_PAIRS // max(1, walls))
    return [slice(first, first + step) for first in range(0, lines, step)]


def _has_sight(points: Array, eyes: Array, walls: Array, near: Mask) -> Mask:
    """No nearby wall (`near`, (n, m)) intersects the line from an eye to its point, (n,)."""
    ray = points - eyes
    distance = np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), CLEAR_OF_SAMPLE_M)
    ends = points - CLEAR_OF_SAMPLE_M * ray / distance
    c, d = walls[:, 0], walls[:, 1]
    on_both_sides = _side(eyes[:, None], ends[:, None], c) * _side(eyes[:, None], ends[:, None], d)
    line, wall = np.nonzero(near & (on_both_sides <= 0))
    a, b, c, d = eyes[line], ends[line], c[wall], d[wall]
    observation: Mask = np.ones(len(points), dtype=bool)
    observation[line[_side(c, d, a) * _side(c, d, b) <= 0]] = False
    return observation


def _side(a: Array, b: Array, p: Array) -> Array:
    """Sign of the side of the line from a to b on which point p lies."""
    along_north, along_east = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    to_north, to_east = p[..., 0] - a[..., 0], p[..., 1] - a[..., 1]
    side: Array = along_north * to_east - along_east * to_north
    return side
