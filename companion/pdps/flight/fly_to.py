"""State machine that flies to a place by a script's order.

    TRAVEL ──arrived──► PLACE ──at the height and heading of the target──► DONE
      │                   │
      │ an obstacle at    │ height or heading do not change any more
      │ the target, or    │
      │ no path           ▼
      └─────────────► REFUSED ◄── any phase: the deadline is over

The map holds at its own height alone. So the drone travels at that height, and climbs or descends
over the target.
"""

import enum
import math
from dataclasses import replace

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2, wrap_rad
from companion.core.messages import HOLD, Pose, Setpoint
from companion.core.values import value
from companion.mapping.occupancy import Occupancy
from companion.navigation import travel as travelling
from companion.navigation.grid_planner import FLOWN_CLEAR_M, TIGHT_CLEAR_M
from companion.navigation.observation import Observation
from companion.navigation.travel_state import Travel, TravelPhase
from companion.pdps.flight.order import Target
from companion.safety.control_laws import stay, turn_towards

AT_HEIGHT_M, AT_YAW_RAD = 0.08, math.radians(3)
"""Maximum errors of the height, m, and of the heading, rad, at which the target is reached.
Chosen."""
NEARER_S, NEARER = 3.0, 0.05
"""Height and heading do not change any more if in this time, s, the sum of their errors, in m and
rad, decreases by less than the second value. Chosen: a sixth of what the drone climbs."""


class FlyToPhase(enum.Enum):
    """States of the diagram above."""

    TRAVEL = "flying to a place"
    PLACE = "turning and climbing at a place"
    DONE = "at a place"
    REFUSED = "place not reached"


@value
class FlyTo:
    """State of a flight to a place."""

    target: Target
    until_s: float
    """Deadline, s."""
    travel: Travel
    phase: FlyToPhase = FlyToPhase.TRAVEL
    refusal: str = ""
    """Reason why the target is not reached; empty without one."""
    nearest: float = math.inf
    """Lowest sum of the errors of height and heading in PLACE, m and rad."""
    nearest_s: float = math.inf
    """Time at which it was measured, s."""

    @classmethod
    def begin(cls, target: Target, until_s: float) -> "FlyTo":
        """The state at the begin."""
        return cls(target, until_s, Travel(target.ne_m))

    @property
    def activity(self) -> str:
        """Description of the phase."""
        return str(self.phase.value)

    def rested(self) -> "FlyTo":
        """The state after a pause: the time without progress begins anew."""
        return replace(self, travel=self.travel.rested(), nearest=math.inf)


def step(
    going: FlyTo, observation: Observation, space: Occupancy, plan: MissionConfig, level_m: float
) -> tuple[FlyTo, Setpoint]:
    """Runs one tick. Returns the next state and the velocity setpoint.

    `level_m`: height of the map above the take-off point, m.
    """
    if observation.pose.time_s >= going.until_s:
        why = f"{_in_words(going.target.ne_m)} was not reached within timeout_s"
        return _refused(going, why), HOLD
    match going.phase:
        case FlyToPhase.TRAVEL:
            return _travel(going, observation, space, plan)
        case FlyToPhase.PLACE:
            return _place(going, observation.pose, plan, level_m)
        case FlyToPhase.DONE | FlyToPhase.REFUSED:
            return going, HOLD


def _travel(
    going: FlyTo, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[FlyTo, Setpoint]:
    goal_ne_m = going.target.ne_m
    if not going.travel.way and _is_occupied(goal_ne_m, space):
        return _refused(going, why_unreachable(goal_ne_m, space)), HOLD
    travel, setpoint = travelling.step(going.travel, observation, space, plan)
    going = replace(going, travel=travel)
    if travel.phase is TravelPhase.GAVE_UP:
        return _refused(going, why_unreachable(goal_ne_m, space)), HOLD
    if travel.phase is TravelPhase.ARRIVED:
        return replace(going, phase=FlyToPhase.PLACE), stay(goal_ne_m, observation.pose)
    return going, setpoint


def _is_occupied(place_ne_m: Vector2, space: Occupancy) -> bool:
    """True if no path leads to a place, whatever else is known."""
    return space.nearest_m(place_ne_m, FLOWN_CLEAR_M) < FLOWN_CLEAR_M


def why_unreachable(place_ne_m: Vector2, space: Occupancy) -> str:
    """The reason why no path leads to a place, with the remedy."""
    where, cell = _in_words(place_ne_m), space.cell(place_ne_m)
    away_m = space.nearest_m(place_ne_m, TIGHT_CLEAR_M)
    if away_m < TIGHT_CLEAR_M:
        return (
            f"{where} is not free: an obstacle is {away_m:.1f} m from it; "
            f"choose a place at least {TIGHT_CLEAR_M} m from all obstacles"
        )
    if not (space.has(cell) and space.free[cell]):
        return f"no sensor has measured the space at {where}; scan it first, or fly in shorter legs"
    return f"no path through measured free space leads to {where}; scan the space between first"


def _in_words(place_ne_m: Vector2) -> str:
    return f"the place {place_ne_m[0]:.1f} m north, {place_ne_m[1]:.1f} m east"


def _place(going: FlyTo, pose: Pose, plan: MissionConfig, level_m: float) -> tuple[FlyTo, Setpoint]:
    target = going.target
    height_m = level_m if target.height_m is None else target.height_m
    yaw_rad = pose.yaw_rad if target.yaw_rad is None else target.yaw_rad
    high_m, off_rad = abs(pose.height_m - height_m), abs(wrap_rad(pose.yaw_rad - yaw_rad))
    if high_m < AT_HEIGHT_M and off_rad < AT_YAW_RAD:
        return replace(going, phase=FlyToPhase.DONE), stay(target.ne_m, pose)
    if high_m + off_rad < going.nearest - NEARER:
        going = replace(going, nearest=high_m + off_rad, nearest_s=pose.time_s)
    elif pose.time_s - going.nearest_s > NEARER_S:
        return _refused(going, _why_not_placed(pose, height_m, yaw_rad)), HOLD
    turn_rad_s = turn_towards(yaw_rad, pose.yaw_rad, math.radians(plan.turn_rate_deg_s))
    return going, replace(stay(target.ne_m, pose), yaw_rate_rad_s=turn_rad_s)


def _why_not_placed(pose: Pose, height_m: float, yaw_rad: float) -> str:
    if abs(pose.height_m - height_m) < AT_HEIGHT_M:
        return f"the drone does not turn to {yaw_rad:.2f} rad: it stays at {pose.yaw_rad:.2f} rad"
    side = "above" if height_m > pose.height_m else "below"
    return (
        f"the height {height_m:.1f} m is not free: the drone stays at {pose.height_m:.1f} m, "
        f"with its clearance to what is {side}"
    )


def _refused(going: FlyTo, why: str) -> FlyTo:
    return replace(going, phase=FlyToPhase.REFUSED, refusal=why)
