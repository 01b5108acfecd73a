"""Where the drone lands if it cannot land at its start: on floor that it has flown over.

Tables and chairs are lower than the level beams. Only the down beam meets them, under the drone's
centre, so a site lies where that beam has met the floor in several cells and nothing else nearby.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.navigation.grid_planner import find_ground, find_ways
from companion.safety.velocity_guard import clear_of_all_m

REACH_M = 6.0
"""As `ShortestPaths.metres` counts, more where it is tight; 20 s of flight. Chosen: a room."""
HULL_M, FLOOR_M = 0.4, 0.5
"""What stands on the floor within the first is under the hull: its radius, and the 0.2 m by which a
landing drifts (docs/autopilot.md). Floor within the second speaks for the site."""
ENOUGH_CELLS = 8
"""Of floor: of two sites that have as many the nearer one is taken. Chosen: a third of all."""


def landing_site(here: Vector2, space: Occupancy, floor: Heights, plan: MissionConfig) -> Vector2:
    """The best place that the drone has been at and can get to, local NED; `here` if none is."""
    grid = space.window((here,), REACH_M)
    ways = find_ways(find_ground(grid, here, clear_of_all_m(plan)))
    ground = ways.ground
    may = np.argwhere(ground.grid.flown & (ways.metres < REACH_M))
    sites = [here, *(ground.grid.place((row, column)) for row, column in may.tolist())]
    cells = np.minimum(_cells_of_floor(sites, floor), ENOUGH_CELLS)
    away_m = [ways.metres[ground.grid.cell(site)] for site in sites]
    best = int(np.lexsort((away_m, -cells))[0])
    return sites[best] if cells[best] > cells[0] else here


def _cells_of_floor(sites: Sequence[Vector2], floor: Heights) -> NDArray[np.int64]:
    """(n,): how many cells near each site are floor; 0 if one under the hull is not."""
    is_floor = floor.is_floor()
    middles = np.array(list(is_floor)).reshape(-1, 2)
    flat = np.array(list(is_floor.values()), dtype=bool)
    off_m = np.linalg.norm(np.array(sites)[:, None] - middles, axis=2)
    stands_under = ((off_m < HULL_M) & ~flat).any(axis=1)
    return np.where(stands_under, 0, ((off_m <= FLOOR_M) & flat).sum(axis=1))
