"""Where the drone lands if it cannot land at its start: on floor that it has flown over.

Tables and chairs are lower than the level beams. Only the down beam meets them, under the drone's
centre, so a site lies where that beam has met the floor in several cells and nothing else nearby.
"""

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.navigation.grid_planner import find_ground, find_ways
from companion.safety.velocity_guard import clear_of_all_m

REACH_M = 6.0
"""As `Ways.metres` counts, which is more where it is tight; 20 s of flight. Chosen: a room."""
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
    may = ground.grid.flown & (ways.metres < REACH_M)
    places = [ground.grid.place((row, column)) for row, column in np.argwhere(may).tolist()]
    if not places:
        return here

    def worth(site: Vector2) -> tuple[int, float]:
        cells = floor.cells_of_floor(site, FLOOR_M, HULL_M)
        return min(cells, ENOUGH_CELLS), -float(ways.metres[ground.grid.cell(site)])

    best = max(places, key=worth)
    return best if worth(best)[0] > floor.cells_of_floor(here, FLOOR_M, HULL_M) else here
