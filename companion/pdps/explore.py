"""Seeing everything that can be reached: look round, go to where something is unseen, again.

            turned, something unseen can be reached
    LOOK ───────────────────────────────────────────► GO ──┐ blocked for a while:
     ▲ │                                              │    │ another way, or another place
     │ └─ turned, nothing unseen is left ─► DONE      │ ◄──┘
     └──────────────────── arrived ───────────────────┘

Safety: it flies only along ways through cells that beams have found free, with the drone's
clearance around them, nose first; something that appears ahead stops it (`follow`). It turns
before it goes anywhere new: three beams at right angles see all around in half a turn.
"""

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from companion.config import MissionConfig
from companion.frames import Vector2, wrap_rad
from companion.mapping.occupancy import Occupancy
from companion.messages import Setpoint
from companion.pdps.control import climb_to
from companion.pdps.follow import Way, follow, is_blocked, stay
from companion.pdps.gaps import is_unseen, next_look
from companion.pdps.room_scan import Sight
from companion.pdps.route import find_ways

FIRST_LOOK_RAD = math.tau
LOOK_RAD = math.pi + math.radians(10)
BLOCKED_S = 3.0
"""How long somebody in the way is waited for."""
CHECK_S = 1.0
"""So often it is asked whether the place that it goes for has been seen on the way."""
BODY_RADIUS_M = 0.2


class ExplorePhase(enum.Enum):
    """Where in the diagram above."""

    LOOK = "looking round"
    GO = "going to where something is unseen"
    DONE = "all that can be reached was seen"


@dataclass(frozen=True, slots=True)
class Explore:
    """The exploration's whole memory."""

    phase: ExplorePhase = ExplorePhase.LOOK
    to_turn_rad: float = FIRST_LOOK_RAD
    last_yaw_rad: float | None = None
    way: Way = ()
    goal_ne_m: Vector2 = (0.0, 0.0)
    """The frontier that the next look is for."""
    looked_at: tuple[Vector2, ...] = ()
    here_ne_m: Vector2 | None = None
    """Where it turns round."""
    checked_s: float = 0.0
    blocked_since_s: float | None = None


def step(
    explore: Explore, sight: Sight, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    """One tick: the next state and the velocity to fly."""
    match explore.phase:
        case ExplorePhase.LOOK:
            return _look(explore, sight, space, plan)
        case ExplorePhase.GO:
            return _go(explore, sight, space, plan)
        case ExplorePhase.DONE:
            return explore, _level(sight, plan)


def _look(
    explore: Explore, sight: Sight, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    yaw_rad = sight.pose.yaw_rad
    last_rad = yaw_rad if explore.last_yaw_rad is None else explore.last_yaw_rad
    left_rad = explore.to_turn_rad - wrap_rad(yaw_rad - last_rad)
    here = explore.here_ne_m or (sight.pose.north_m, sight.pose.east_m)
    is_first = not explore.looked_at
    if left_rad > 0 and (is_first or is_unseen(space, explore.goal_ne_m)):
        turning = replace(explore, to_turn_rad=left_rad, last_yaw_rad=yaw_rad, here_ne_m=here)
        rate_rad_s = math.radians(plan.turn_rate_deg_s)
        return turning, replace(stay(here, sight, plan), yaw_rate_rad_s=rate_rad_s)
    return _chosen(explore, sight, space, plan), _level(sight, plan)


def _chosen(explore: Explore, sight: Sight, space: Occupancy, plan: MissionConfig) -> Explore:
    """Where to go to next."""
    here = sight.pose.north_m, sight.pose.east_m
    ways = find_ways(space, here, BODY_RADIUS_M + plan.clearance_m)
    look = next_look(space, ways, explore.looked_at)
    if look is None:
        return replace(explore, phase=ExplorePhase.DONE, way=())
    return replace(
        explore,
        phase=ExplorePhase.GO,
        way=ways.to(look.from_ne_m),
        goal_ne_m=look.at_ne_m,
        looked_at=(*explore.looked_at, look.at_ne_m),
        here_ne_m=None,
        checked_s=sight.pose.time_s,
        blocked_since_s=None,
    )


def _go(
    explore: Explore, sight: Sight, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    if is_blocked(explore.way, sight):
        return _wait(explore, sight, lambda: _chosen(explore, sight, space, plan)), _level(
            sight, plan
        )
    if sight.pose.time_s - explore.checked_s > CHECK_S:
        explore = replace(explore, checked_s=sight.pose.time_s)
        if not is_unseen(space, explore.goal_ne_m):
            return _chosen(explore, sight, space, plan), _level(sight, plan)
    way, setpoint = follow(explore.way, sight, space, plan)
    if not way:
        looking = replace(
            explore, phase=ExplorePhase.LOOK, to_turn_rad=LOOK_RAD, last_yaw_rad=None, way=()
        )
        return looking, setpoint
    return replace(explore, way=way, blocked_since_s=None), setpoint


def _wait(explore: Explore, sight: Sight, otherwise: Callable[[], Explore]) -> Explore:
    since_s = explore.blocked_since_s
    if since_s is None:
        return replace(explore, blocked_since_s=sight.pose.time_s)
    return otherwise() if sight.pose.time_s - since_s > BLOCKED_S else explore


def _level(sight: Sight, plan: MissionConfig) -> Setpoint:
    return Setpoint(down_m_s=climb_to(plan.height_m, sight.pose.height_m))
