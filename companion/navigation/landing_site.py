"""Selects a landing site, on floor under flown cells, if the drone cannot land at its start.

Tables and chairs are lower than the level beams. Only the down beam detects them, under the drone's
centre. So a site is a place where that beam measured the floor in several cells, and nothing else
nearby.
"""

from collections.abc import Sequence

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.arrays import Indices
from companion.core.frames import Vector2
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.navigation.grid_planner import find_ground, find_ways
from companion.safety.velocity_guard import clear_of_all_m

MAX_PATH_COST_M = 6.0
"""Maximum cost of the path to a site, m, as `ShortestPaths.metres` counts it; 20 s of flight.
Chosen: the size of a room."""
HULL_M, FLOOR_M = 0.4, 0.5
"""Radii around a site, m. An obstacle within the first rejects the site; floor cells within the
second count for it. The first is the hull's radius and the 0.2 m of drift of a landing
(docs/autopilot.md)."""
ENOUGH_CELLS = 8
"""Number of floor cells above which sites rank equal; then the nearer site is selected.
Chosen: a third of all cells within `FLOOR_M`."""


def landing_site(here: Vector2, space: Occupancy, floor: Heights, plan: MissionConfig) -> Vector2:
    """The best site among the reachable cells that the drone has flown over, local NED, m.

    Returns `here` if no site has more floor cells.
    """
    grid = space.window((here,), MAX_PATH_COST_M)
    ways = find_ways(find_ground(grid, here, clear_of_all_m(plan)))
    ground = ways.ground
    may = np.argwhere(ground.grid.flown & (ways.metres < MAX_PATH_COST_M))
    sites = [here, *(ground.grid.place((row, column)) for row, column in may.tolist())]
    cells = np.minimum(_cells_of_floor(sites, floor), ENOUGH_CELLS)
    away_m = [ways.metres[ground.grid.cell(site)] for site in sites]
    best = int(np.lexsort((away_m, -cells))[0])
    return sites[best] if cells[best] > cells[0] else here


def _cells_of_floor(sites: Sequence[Vector2], floor: Heights) -> Indices:
    """Number of floor cells near each site, (n,); 0 if a cell under the hull is not floor."""
    is_floor = floor.is_floor()
    middles = np.array(list(is_floor)).reshape(-1, 2)
    flat = np.array(list(is_floor.values()), dtype=bool)
    off_m = np.linalg.norm(np.array(sites)[:, None] - middles, axis=2)
    stands_under = ((off_m < HULL_M) & ~flat).any(axis=1)
    return np.where(stands_under, 0, ((off_m <= FLOOR_M) & flat).sum(axis=1))
