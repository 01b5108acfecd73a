"""Flying over everything once, so that the down beam meets what stands lower: tables, boxes.

    CHOOSE ──not flown over yet──► GO ──there, or no way──► CHOOSE
       └──all was, or it has taken long──► DONE

Straight on as long as there is something new ahead: turning takes as long as a metre or two. Along
the walls, where most tables stand, the tracks are closer.

Safety: it goes only where `travel` goes.
"""

import enum
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from companion.config import MissionConfig
from companion.frames import Vector2
from companion.mapping.occupancy import CELL_M, Cells, Occupancy
from companion.messages import HOLD, Setpoint
from companion.pdps import travel
from companion.pdps.doorways import Doorway
from companion.pdps.guard import clear_of_all_m
from companion.pdps.looks import turn_rad
from companion.pdps.route import Ways, find_ground, find_ways
from companion.pdps.sight import Sight
from companion.pdps.travel import Travel, TravelPhase
from companion.pdps.unseen import without_specks

OVER_M, OVER_BY_WALLS_M = 1.2, 0.3
"""What is no farther from where the drone has flown counts as flown over."""
WALL_WITHIN_M = 0.7
NEAR_ENOUGH_M = 0.3
LEAST_CELLS = 12
"""An eighth of a square metre: less is not worth a turn."""
AIMED_WITHIN_M = 0.6
MOST_S = 120.0
"""What was not flown over by then is left: it is an extra, and the battery is not for it alone."""
STRAIGHT_ON_M = 6.0
Cell = tuple[int, int]


class OverflyPhase(enum.Enum):
    """Where in the diagram above."""

    CHOOSE = "choosing what to fly over"
    GO = "flying over everything"
    DONE = "all was flown over"


@dataclass(frozen=True, slots=True)
class Overfly:
    """The whole memory."""

    phase: OverflyPhase = OverflyPhase.CHOOSE
    began_s: float = math.inf
    travel: Travel | None = None
    """In GO."""
    doorways: tuple[Doorway, ...] = ()
    aimed_at: tuple[Vector2, ...] = ()
    """Reached as nearly as that goes, or given up: neither is tried again."""


def step(
    overfly: Overfly, sight: Sight, space: Occupancy, plan: MissionConfig
) -> tuple[Overfly, Setpoint]:
    """One tick: the next state and the velocity to fly."""
    if overfly.phase is OverflyPhase.CHOOSE:
        return _choose(overfly, sight, space, plan), HOLD
    if overfly.travel is None or overfly.phase is OverflyPhase.DONE:
        return overfly, HOLD
    going, setpoint = travel.step(overfly.travel, sight, space, plan)
    match going.phase:
        case TravelPhase.ARRIVED | TravelPhase.GAVE_UP:
            aimed_at = (*overfly.aimed_at, going.goal_ne_m)
            chosen = Overfly(began_s=overfly.began_s, doorways=going.known, aimed_at=aimed_at)
            return chosen, setpoint
        case _:
            return replace(overfly, travel=going), setpoint


def _choose(overfly: Overfly, sight: Sight, space: Occupancy, plan: MissionConfig) -> Overfly:
    here, now_s = (sight.pose.north_m, sight.pose.east_m), sight.pose.time_s
    overfly = replace(overfly, began_s=min(overfly.began_s, now_s))
    if now_s - overfly.began_s > MOST_S:
        return replace(overfly, phase=OverflyPhase.DONE)
    ways = find_ways(find_ground(space, here, clear_of_all_m(plan)))
    left = _not_flown_over(ways, overfly.aimed_at)
    if not left.any():
        return replace(overfly, phase=OverflyPhase.DONE)
    goal = Travel(_goal(left, ways, sight, plan), NEAR_ENOUGH_M, known=overfly.doorways)
    return replace(overfly, phase=OverflyPhase.GO, travel=travel.along(ways, goal, sight))


def _not_flown_over(ways: Ways, aimed_at: tuple[Vector2, ...]) -> Cells:
    grid = ways.ground.grid
    flown = grid.flown.copy()
    flown[ways.ground.start] = True
    over_m = np.where(ways.ground.room_m < WALL_WITHIN_M, OVER_BY_WALLS_M, OVER_M)
    left: Cells = distance_transform_edt(~flown) * CELL_M > over_m
    left &= np.isfinite(ways.metres)
    rows, columns = np.indices(left.shape)
    for row, column in map(grid.cell, aimed_at):
        left &= np.hypot(rows - row, columns - column) * CELL_M > AIMED_WITHIN_M
    return without_specks(left, LEAST_CELLS)


def _goal(left: Cells, ways: Ways, sight: Sight, plan: MissionConfig) -> Vector2:
    """The place that is reached soonest, turning counted, or farther straight on from it."""
    cells = np.argwhere(left)
    turn_s = turn_rad(sight, cells, ways.ground.grid) / math.radians(plan.turn_rate_deg_s)
    soonest = int(np.argmin(ways.metres[tuple(cells.T)] / plan.speed_m_s + turn_s))
    row, column = cells[soonest].tolist()
    towards = cells[soonest] - np.array(ways.ground.start)
    return ways.ground.grid.place(_straight_on((row, column), towards, left))


def _straight_on(cell: Cell, towards: NDArray[np.int64], left: Cells) -> Cell:
    """The last place from a cell on that is in a row with it, none of them flown over yet."""
    unit = towards / max(float(np.hypot(*towards)), 1.0)
    for step_cells in range(1, round(STRAIGHT_ON_M / CELL_M)):
        row, column = np.rint(cell + step_cells * unit).astype(int).tolist()
        inside = 0 <= row < left.shape[0] and 0 <= column < left.shape[1]
        if not inside or not left[row, column]:
            row, column = np.rint(cell + (step_cells - 1) * unit).astype(int).tolist()
            return row, column
    return row, column
