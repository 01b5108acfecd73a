"""Seeing everything that can be reached: look round, go to where most is unseen, again.

            turned, something unseen can be reached
    LOOK ───────────────────────────────────────────► GO ──┐ blocked for a while, or seen
     ▲ │                                              │    │ on the way: another way or place
     │ └─ turned, nothing unseen is left ─► DONE      │ ◄──┘
     └──────────────────── arrived ───────────────────┘

Safety: it flies only along ways through cells that beams have found free, with the drone's
clearance around them, nose first; something that appears ahead stops it (`follow`, `guard`). It
turns before it goes anywhere new: three beams at right angles see all around in half a turn.
"""

import enum
import math
from dataclasses import dataclass, replace

from companion.config import MissionConfig
from companion.frames import Vector2, wrap_rad
from companion.mapping.occupancy import Occupancy
from companion.messages import Setpoint
from companion.pdps.control import climb_to
from companion.pdps.follow import Way, follow, is_blocked, stay
from companion.pdps.gaps import Places, next_look, still_unseen
from companion.pdps.guard import BODY_RADIUS_M
from companion.pdps.room_scan import Sight
from companion.pdps.route import find_ways

FIRST_LOOK_RAD = math.tau
LOOK_RAD = math.pi + math.radians(10)
BLOCKED_S = 3.0
"""How long somebody in the way is waited for."""
STUCK_S, STUCK_M = 8.0, 0.25
"""So long without getting so far, and the drone tries another place."""
CHECK_S = 1.0
"""So often it is asked whether the place that it goes for is still worth it, and the way good."""
WORTH_SHARE = 0.35
"""Of what it goes for; when less of it is still unseen, there may be a better place."""


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
    look_from_ne_m: Vector2 | None = None
    """Where it goes to, and then turns round."""
    look_at_ne_m: Places = ()
    """What the next look is for; empty at the first."""
    tried: Places = ()
    """Looked at, and no better known."""
    checked_s: float = 0.0
    blocked_since_s: float | None = None
    progress_s: float = 0.0
    progress_ne_m: Vector2 = (0.0, 0.0)
    """When and where it last got on."""


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
    yaw_rad, now_s = sight.pose.yaw_rad, sight.pose.time_s
    last_rad = yaw_rad if explore.last_yaw_rad is None else explore.last_yaw_rad
    left_rad = explore.to_turn_rad - wrap_rad(yaw_rad - last_rad)
    here = explore.look_from_ne_m or (sight.pose.north_m, sight.pose.east_m)
    is_enough = left_rad <= 0
    if not is_enough and explore.look_at_ne_m and now_s - explore.checked_s > CHECK_S:
        explore = replace(explore, checked_s=now_s)
        is_enough = not still_unseen(space, explore.look_at_ne_m)
    if is_enough:
        in_vain = still_unseen(space, explore.look_at_ne_m)
        looked = replace(explore, tried=(*explore.tried, *in_vain))
        return _chosen(looked, sight, space, plan), _level(sight, plan)
    turning = replace(explore, to_turn_rad=left_rad, last_yaw_rad=yaw_rad, look_from_ne_m=here)
    rate_rad_s = math.radians(plan.turn_rate_deg_s)
    return turning, replace(stay(here, sight, plan), yaw_rate_rad_s=rate_rad_s)


def _chosen(explore: Explore, sight: Sight, space: Occupancy, plan: MissionConfig) -> Explore:
    """Where to go to next."""
    here = sight.pose.north_m, sight.pose.east_m
    ways = find_ways(space, here, BODY_RADIUS_M + plan.clearance_m)
    look = next_look(space, ways, plan.speed_m_s, explore.tried)
    if look is None:
        return replace(explore, phase=ExplorePhase.DONE, way=())
    return replace(
        explore,
        phase=ExplorePhase.GO,
        way=ways.to(look.from_ne_m),
        look_from_ne_m=look.from_ne_m,
        look_at_ne_m=look.at_ne_m,
        checked_s=sight.pose.time_s,
        blocked_since_s=None,
        progress_s=sight.pose.time_s,
        progress_ne_m=here,
    )


def _go(
    explore: Explore, sight: Sight, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    explore = _progress(explore, sight)
    if sight.pose.time_s - explore.progress_s > STUCK_S:
        stuck = replace(explore, tried=(*explore.tried, *explore.look_at_ne_m))
        return _chosen(stuck, sight, space, plan), _level(sight, plan)
    if is_blocked(explore.way, sight):
        return _wait(explore, sight, space, plan), _level(sight, plan)
    if sight.pose.time_s - explore.checked_s > CHECK_S:
        explore = _checked(explore, sight, space, plan)
    way, setpoint = follow(explore.way, sight, space, plan)
    if not way:
        looking = replace(
            explore, phase=ExplorePhase.LOOK, to_turn_rad=LOOK_RAD, last_yaw_rad=None, way=()
        )
        return looking, setpoint
    return replace(explore, way=way, blocked_since_s=None), setpoint


def _progress(explore: Explore, sight: Sight) -> Explore:
    """Also who turns gets on."""
    here = sight.pose.north_m, sight.pose.east_m
    if math.dist(here, explore.progress_ne_m) < STUCK_M:
        return explore
    return replace(explore, progress_s=sight.pose.time_s, progress_ne_m=here)


def _checked(explore: Explore, sight: Sight, space: Occupancy, plan: MissionConfig) -> Explore:
    """The way by what is known now; another place, if there is little left to see or no way."""
    left = still_unseen(space, explore.look_at_ne_m)
    if len(left) < WORTH_SHARE * len(explore.look_at_ne_m) or explore.look_from_ne_m is None:
        return _chosen(explore, sight, space, plan)
    here = sight.pose.north_m, sight.pose.east_m
    ways = find_ways(space, here, BODY_RADIUS_M + plan.clearance_m)
    if not ways.reaches(explore.look_from_ne_m):
        return _chosen(explore, sight, space, plan)
    way = ways.to(explore.look_from_ne_m)
    return replace(explore, way=way, checked_s=sight.pose.time_s)


def _wait(explore: Explore, sight: Sight, space: Occupancy, plan: MissionConfig) -> Explore:
    since_s = explore.blocked_since_s
    if since_s is None:
        return replace(explore, blocked_since_s=sight.pose.time_s)
    if sight.pose.time_s - since_s < BLOCKED_S:
        return explore
    return _chosen(explore, sight, space, plan)


def _level(sight: Sight, plan: MissionConfig) -> Setpoint:
    return Setpoint(down_m_s=climb_to(plan.height_m, sight.pose.height_m))
