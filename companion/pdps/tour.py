"""Finds the shortest tour through several places that ends at home.

A nearest-first order leaves corners of a room unseen, and returns to them through the doorway.
"""

import numpy as np
from scipy.sparse.csgraph import dijkstra

from companion.core.arrays import Array, Indices
from companion.core.frames import Vector2
from companion.navigation.grid_planner import ShortestPaths, graph

COARSE_CELLS = 3
"""Reduction of the grid for this search, in cells. Chosen: a few decimetres do not change the
order."""
FAR_M = 1e3
"""Cost between places without a path, m; for example home, after a door behind was shut. Chosen."""


def first_of_tour(ways: ShortestPaths, places: tuple[Vector2, ...], home_ne_m: Vector2) -> int:
    """Index of the place with which the shortest tour begins. `ways` must reach all places."""
    if len(places) == 1:
        return 0
    stops = [ways.ground.grid.cell(place) for place in (*places, home_ne_m)]
    between = _between_m(ways, np.array([ways.ground.start, *stops]))
    return shortest_first(between[0, 1:-1], between[1:-1, 1:-1], between[1:-1, -1])


def _between_m(ways: ShortestPaths, cells: Indices) -> Array:
    """Costs of the paths between cells (n, 2), on a coarser grid; (n, n)."""
    rows, columns = (-np.array(ways.ground.cost.shape)) % COARSE_CELLS
    cost = np.pad(ways.ground.cost, ((0, rows), (0, columns)), constant_values=np.inf)
    tall, wide = cost.shape[0] // COARSE_CELLS, cost.shape[1] // COARSE_CELLS
    coarse = cost.reshape(tall, COARSE_CELLS, wide, COARSE_CELLS).min(axis=(1, 3))
    numbers = cells // COARSE_CELLS @ np.array([wide, 1])
    metres: Array = dijkstra(graph(coarse), directed=False, indices=numbers)[:, numbers]
    return COARSE_CELLS * np.where(np.isfinite(metres), metres, FAR_M)


def shortest_first(from_here: Array, between: Array, to_home: Array) -> int:
    """Index of the first place of the shortest path through all n places (Held and Karp 1962).

    `least[visited, last]` is the length of the shortest path through a set of places, one bit each,
    that ends in `last`. `first` is the place where that path begins. Costs are from here (n,),
    between places (n, n) and to home (n,).
    """
    n = len(from_here)
    least = np.full((1 << n, n), np.inf)
    first = np.zeros((1 << n, n), dtype=int)
    alone = 1 << np.arange(n)
    least[alone, np.arange(n)] = from_here
    first[alone, np.arange(n)] = np.arange(n)
    for visited in range(1, 1 << n):
        to_next = least[visited][:, None] + between
        last = to_next.argmin(axis=0)
        left = np.flatnonzero(~visited & alone)
        further = visited | alone[left]
        least[further, left] = to_next[last[left], left]
        first[further, left] = first[visited, last[left]]
    return int(first[-1, (least[-1] + to_home).argmin()])
