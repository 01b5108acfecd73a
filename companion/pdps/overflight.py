"""State machine that flies over all free space once, so that the down beam detects low obstacles.

    CHOOSE ──not flown over yet──► GO ──arrived, or no path──► CHOOSE
       └──all was, or others are nearer──► DONE

The drone flies straight on as long as it covers new floor: a turn or a stop takes as long as a
metre or two of flight. Along the walls, where most tables stand, the tracks are closer. In a team
it leaves to the others what they reach sooner.

Safety: the drone flies only where `travel` does.
"""

import enum
import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt, uniform_filter

from companion.config.settings import MissionConfig
from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2
from companion.core.messages import HOLD, Setpoint
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.navigation import travel
from companion.navigation.grid_planner import (
    START_NE_M,
    CostGrid,
    ShortestPaths,
    find_ground,
    find_ways,
)
from companion.navigation.observation import Observation
from companion.navigation.travel_state import Travel, TravelPhase, onward
from companion.pdps.claims import sooner_reached
from companion.pdps.frontiers import without_specks
from companion.pdps.viewpoints import turn_rad
from companion.safety.velocity_guard import clear_of_all_m

OVER_M, OVER_BY_WALLS_M = 1.2, 0.2
"""Cells within this distance of the flown track count as flown over, m: in the open, and near
walls. Chosen."""
WALL_WITHIN_M = 0.7
"""Cells with less clearance than this are near a wall, m. Chosen."""
NEAR_ENOUGH_M = 0.3
"""Arrival radius at a goal, m. Chosen."""
MIN_CELLS = 12
"""Minimum size of a goal area, in cells: 1/8 m². Chosen: a smaller one does not justify a turn."""
AIMED_WITHIN_M = 0.6
"""Cells within this distance of an earlier goal are not a goal again, m. Chosen."""
STRAIGHT_ON_M, HEADINGS = 6.0, 72
"""Maximum length of a straight track, m, and number of directions that are compared. Chosen."""
STOP_S = 2.0
"""Time for the stop at the end of a straight track, s. Chosen."""
MIN_MET = 4.0
"""Minimum number of new cells along a straight track. Chosen: with fewer, the nearest remaining
cell is the goal."""


class OverflyPhase(enum.Enum):
    """States of the diagram above."""

    CHOOSE = "choosing what to fly over"
    GO = "flying over everything"
    DONE = "all was flown over"


@dataclass(frozen=True, slots=True)
class Overfly:
    """State of the overflight."""

    phase: OverflyPhase = OverflyPhase.CHOOSE
    travel: Travel | None = None
    """Journey to the goal, in GO."""
    came: Travel | None = None
    """The last journey."""
    aimed_at: tuple[Vector2, ...] = ()
    """Earlier goals, reached or given up, local NED, m. They are not tried again."""


def step(
    overfly: Overfly, observation: Observation, space: Occupancy, plan: MissionConfig, layer: int
) -> tuple[Overfly, Setpoint]:
    """Runs one tick in a layer. Returns the next state and the velocity setpoint."""
    if overfly.phase is OverflyPhase.CHOOSE:
        return _choose(overfly, observation, space, plan, layer), HOLD
    if overfly.travel is None or overfly.phase is OverflyPhase.DONE:
        return overfly, HOLD
    going, setpoint = travel.step(overfly.travel, observation, space, plan)
    match going.phase:
        case TravelPhase.ARRIVED | TravelPhase.GAVE_UP:
            aimed_at = (*overfly.aimed_at, going.goal_ne_m)
            return Overfly(came=replace(going, course=None), aimed_at=aimed_at), setpoint
        case _:
            return replace(overfly, travel=going), setpoint


def is_left(
    overfly: Overfly, observation: Observation, space: Occupancy, plan: MissionConfig, layer: int
) -> bool:
    """True if something is left to fly over in a layer, from the start on."""
    ways = find_ways(find_ground(space, START_NE_M, clear_of_all_m(plan)))
    return bool(_not_flown_over(ways, overfly.aimed_at, observation, layer).any())


def _choose(
    overfly: Overfly, observation: Observation, space: Occupancy, plan: MissionConfig, layer: int
) -> Overfly:
    here = observation.pose.ne_m
    ways = find_ways(find_ground(space, here, clear_of_all_m(plan)))
    left = _not_flown_over(ways, overfly.aimed_at, observation, layer)
    left = sooner_reached(left, ways, observation.claims)
    if not left.any():
        return replace(overfly, phase=OverflyPhase.DONE)
    goal = onward(overfly.came, _goal(left, ways, observation, plan), NEAR_ENOUGH_M)
    return replace(overfly, phase=OverflyPhase.GO, travel=travel.along(ways, goal, observation))


def _not_flown_over(
    ways: ShortestPaths, aimed_at: tuple[Vector2, ...], observation: Observation, layer: int
) -> Mask:
    """Reachable cells that no drone has flown over, nor flies over now."""
    grid = ways.ground.grid
    flown = grid.flown.copy()
    flown[ways.ground.start] = True
    if observation.team_layers is not None:
        by_others = observation.team_layers.flown_ne_m(layer).tolist()
        to_be = (place for claim in observation.claims for place in claim.places_ne_m)
        for cell in filter(grid.has, map(grid.cell, (*by_others, *to_be))):
            flown[cell] = True
    over_m = np.where(ways.ground.room_m < WALL_WITHIN_M, OVER_BY_WALLS_M, OVER_M)
    left: Mask = distance_transform_edt(~flown) * CELL_M > over_m
    left &= np.isfinite(ways.metres)
    rows, columns = np.indices(left.shape)
    for row, column in map(grid.cell, aimed_at):
        left &= np.hypot(rows - row, columns - column) * CELL_M > AIMED_WITHIN_M
    return without_specks(left, MIN_CELLS)


def _goal(
    left: Mask, ways: ShortestPaths, observation: Observation, plan: MissionConfig
) -> Vector2:
    """Goal: the end of the straight track with most new cells for its time, or the nearest cell."""
    grid = ways.ground.grid
    ends, meets = _straight_on(left, ways.ground)
    worth = meets / (_seconds(ends, ways, observation, plan) + STOP_S)
    best = int(np.argmax(worth))
    if meets[best] < MIN_MET:
        ends = np.argwhere(left)
        best = int(np.argmin(_seconds(ends, ways, observation, plan)))
    row, column = ends[best].tolist()
    return grid.place((row, column))


def _seconds(
    cells: Indices, ways: ShortestPaths, observation: Observation, plan: MissionConfig
) -> Array:
    """Time to fly to each cell (n, 2), with the turn towards it, s; (n,)."""
    turn_s = turn_rad(observation, cells, ways.ground.grid) / math.radians(plan.turn_rate_deg_s)
    seconds: Array = ways.metres[tuple(cells.T)] / plan.speed_m_s + turn_s
    return seconds


def _straight_on(left: Mask, ground: CostGrid) -> tuple[Indices, Array]:
    """Ends (n, 2) of straight tracks in all directions and lengths, and the new cells on them (n,).

    The count is averaged over the width of the track.
    """
    width_cells = 2 * round(OVER_BY_WALLS_M / CELL_M) + 1
    beside = uniform_filter(left.astype(float), width_cells)
    away = np.arange(STRAIGHT_ON_M / CELL_M)
    aside_rad = np.linspace(-math.pi, math.pi, HEADINGS, endpoint=False)[:, None]
    rows = np.rint(ground.start[0] + away * np.cos(aside_rad)).astype(int)
    columns = np.rint(ground.start[1] + away * np.sin(aside_rad)).astype(int)
    inside = (rows >= 0) & (rows < left.shape[0]) & (columns >= 0) & (columns < left.shape[1])
    rows, columns = rows * inside, columns * inside
    open_so_far = np.logical_and.accumulate(inside & ground.passable[rows, columns], axis=1)
    meets = np.cumsum(beside[rows, columns], axis=1)[open_so_far]
    return np.column_stack([rows[open_so_far], columns[open_so_far]]), meets
