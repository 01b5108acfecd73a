"""The true walls seen from above, at one height, and which of them could be seen."""

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from companion.frames import Vector2
from sitl.world.format import Segment, World
from sitl.world.model import WorldModel

Points = NDArray[np.float64]

SAMPLE_M = 0.05
CELL_M = 0.15
"""Of the grid over which the drone is moved about."""
NARROWEST_DOOR_M = 0.9
"""It need not go through what is narrower: openings like that are marked, not entered."""
OUTSIDE_M = 1.0
"""The drone need go no farther out than this: outside, once round."""
SEEN_FROM_M = 1.5
"""A wall counts as one that could be seen if the drone can hover this near, facing it."""
CLEAR_OF_SAMPLE_M = 0.03
MOST_VIEWPOINTS = 60


def wall_surfaces(world: World, height_m: float) -> list[Segment]:
    """Segments, (north, east) in metres, of all that stands at this height."""
    surfaces: list[Segment] = []
    for panel in world.panels:
        if panel.bottom_m <= height_m <= panel.top_m:
            surfaces += panel.outline
    for box in world.boxes:
        if box.bottom_m <= height_m <= box.top_m:
            surfaces += box.segments
    if world.mesh is not None:
        surfaces += world.mesh.section(height_m)
    return surfaces


def samples(segments: list[Segment]) -> Points:
    """Points every 5 cm along the segments, (n, 2)."""
    pieces = []
    for start, end in segments:
        count = max(1, round(math.dist(start, end) / SAMPLE_M))
        share = ((np.arange(count) + 0.5) / count)[:, None]
        pieces.append((1 - share) * np.array(start) + share * np.array(end))
    return np.concatenate(pieces) if pieces else np.empty((0, 2))


def seeable_points(world: World, height_m: float, start: Vector2) -> Points:
    """Samples of the surfaces that a drone which starts there could fly up to and see."""
    surfaces = wall_surfaces(world, height_m)
    reached = _reachable(world, height_m, start)
    walls = np.array(surfaces, dtype=float).reshape(-1, 2, 2)
    points = samples(surfaces)
    tree = cKDTree(reached)
    low, high = walls.min(axis=1), walls.max(axis=1)
    seen = []
    for point in points:
        is_near = ((low <= point + SEEN_FROM_M) & (high >= point - SEEN_FROM_M)).all(axis=1)
        seen.append(_is_seen(point, reached[_near(tree, point)], walls[is_near]))
    visible: Points = points[np.array(seen, dtype=bool)]
    return visible


def _reachable(world: World, height_m: float, start: Vector2) -> Points:
    """Cell centres that the drone can be brought to through doors at this height, (n, 2)."""
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
    """What there is, and a start that lies well outside."""
    low, high = world.bounds
    return (
        (min(low[0], start[0]), min(low[1], start[1])),
        (max(high[0], start[0]), max(high[1], start[1])),
    )


def _near(tree: cKDTree, point: Points) -> NDArray[np.int64]:
    """The nearest reachable places, few enough to look from each."""
    distance, index = tree.query(point, k=MOST_VIEWPOINTS, distance_upper_bound=SEEN_FROM_M)
    found: NDArray[np.int64] = index[np.isfinite(distance)]
    return found


def _is_seen(point: Points, eyes: Points, walls: Points) -> bool:
    """From one of these places there is a clear line to the point."""
    if not len(eyes):
        return False
    ray = point - eyes
    distance = np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), CLEAR_OF_SAMPLE_M)
    ends = point - CLEAR_OF_SAMPLE_M * ray / distance
    return bool((~_crosses(eyes, ends, walls)).any())


def _crosses(starts: Points, ends: Points, walls: Points) -> Any:
    """For each line of sight whether any wall cuts it; booleans (n,)."""
    a, b = starts[:, None], ends[:, None]
    c, d = walls[None, :, 0], walls[None, :, 1]
    cuts = (_side(a, b, c) * _side(a, b, d) <= 0) & (_side(c, d, a) * _side(c, d, b) <= 0)
    return cuts.any(axis=1)


def _side(a: Points, b: Points, p: Points) -> Points:
    """On which side of the line from a to b the point p is."""
    along, to = b - a, p - a
    side: Points = along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0]
    return side
