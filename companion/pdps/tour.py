"""In which order to go to several places, and home in the end, so that it takes least.

The nearest first would leave corners of a room behind, and come back for them through the doorway.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from companion.core.frames import Vector2
from companion.navigation.grid_planner import ShortestPaths, graph

COARSE_CELLS = 3
"""The order does not hang on a few decimetres."""
FAR_M = 1e3
"""To where no way is known, as home when something was shut behind."""
Costs = NDArray[np.float64]


def first_of_tour(ways: ShortestPaths, places: tuple[Vector2, ...], home_ne_m: Vector2) -> int:
    """Which of the places, that `ways` reaches, the shortest tour of all begins with."""
    if len(places) == 1:
        return 0
    stops = [ways.ground.grid.cell(place) for place in (*places, home_ne_m)]
    between = _between_m(ways, np.array([ways.ground.start, *stops]))
    return shortest_first(between[0, 1:-1], between[1:-1, 1:-1], between[1:-1, -1])


def _between_m(ways: ShortestPaths, cells: NDArray[np.int64]) -> Costs:
    """(n, n): the ways' costs between cells (n, 2), on a coarser grid."""
    rows, columns = (-np.array(ways.ground.cost.shape)) % COARSE_CELLS
    cost = np.pad(ways.ground.cost, ((0, rows), (0, columns)), constant_values=np.inf)
    tall, wide = cost.shape[0] // COARSE_CELLS, cost.shape[1] // COARSE_CELLS
    coarse = cost.reshape(tall, COARSE_CELLS, wide, COARSE_CELLS).min(axis=(1, 3))
    numbers = cells // COARSE_CELLS @ np.array([wide, 1])
    metres: Costs = dijkstra(graph(coarse), directed=False, indices=numbers)[:, numbers]
    return COARSE_CELLS * np.where(np.isfinite(metres), metres, FAR_M)


def shortest_first(from_here: Costs, between: Costs, to_home: Costs) -> int:
    """Where the shortest way through all n places begins (Held and Karp 1962).

    `least[visited, last]` is the shortest way through a set of places, a bit each, that ends in
    `last`; `first` is where that begins.
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
