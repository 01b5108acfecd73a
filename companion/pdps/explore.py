"""State machine that explores all reachable space: turn, select the next viewpoint, fly there.

          turned, or            a target can be reached,
          all targets seen      or else a wall is uncertain
    LOOK ────────────────► CHOOSE ──────────────► GO
     ▲                      │   ▲                 │ │
     │          no target   │   └─────────────────┘ │
     │                      ▼   no path, targets    │
     │                     DONE seen from the path, │
     │                          or a teammate goes  │
     └──────────────────────────────────────────────┘
            near the viewpoint, targets still unseen

    CHOOSE ─► WAIT ─► CHOOSE: teammates look at all that is left; what they see may open more.
    The drone waits where others can pass

The drone rarely stops. The swing of its nose shows the space ahead and beside the path. For the
remaining targets it turns while it flies the last metres, only as far as one of three beams needs.
It selects the next viewpoint while it continues to fly.

Safety: the drone flies only where `travel` does, through cells that beams measured as free; the
last metres are straight.
"""

import enum
import math
from dataclasses import dataclass, replace

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2, wrap_rad
from companion.core.messages import BEARING_FRD_RAD, HOLD, Beam, Pose, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.navigation import travel
from companion.navigation.doorway_claims import out_of_the_way
from companion.navigation.doorways import Doorway, too_narrow, with_shut
from companion.navigation.grid_planner import (
    START_NE_M,
    CostGrid,
    ShortestPaths,
    find_ground,
    find_ways,
)
from companion.navigation.observation import Observation
from companion.navigation.path_follower import ARRIVED_M
from companion.navigation.travel_state import Travel, TravelPhase, onward, stuck_twice
from companion.pdps.claims import is_claimed, is_more_expected, on_own_side
from companion.pdps.frontiers import Places, still_unseen
from companion.pdps.loop_views import again, ties
from companion.pdps.tour import first_of_tour
from companion.pdps.viewpoints import Viewpoint, looks
from companion.safety.control_laws import glide, stay
from companion.safety.velocity_guard import clear_of_all_m

FIRST_LOOK_RAD = math.tau
"""Angle of the first turn, rad."""
MAX_LOOK_RAD = math.pi + math.radians(10)
"""Maximum angle of a later turn, rad. Chosen."""
PAST_RAD = math.radians(15)
"""Margin of a turn beyond the last target, rad. Chosen."""
SIDES_RAD = np.array([BEARING_FRD_RAD[beam] for beam in (Beam.LEFT, Beam.FRONT, Beam.RIGHT)])
"""Bearings of the beams that sweep targets, body frame (FRD), rad."""
NEAR_ENOUGH_M = 2.0
"""Distance to the viewpoint at which the turn begins, m. Chosen."""
GLIDE_SHARE = 0.6
"""Speed during the turn, as a share of the planned speed. Chosen: the nose does not point along
the path then."""
CHECK_S = 1.0
"""Period of checking which targets are still unseen, s. Chosen."""
WAIT_S, ASIDE_M = 1.0, 0.3
"""Time of waiting before the next choice, s, and least distance that the drone flies out of the way
to wait, m. Chosen."""
WORTH_SHARE = 0.35
"""If a smaller share of the targets is left, the next viewpoint is selected. Chosen."""


class ExplorePhase(enum.Enum):
    """States of the diagram above."""

    LOOK = "looking round"
    CHOOSE = "choosing where to look from"
    GO = "going to where something is unseen"
    WAIT = "waiting for what teammates find"
    DONE = "all that can be reached was seen"


@dataclass(frozen=True, slots=True)
class Explore:
    """State of the exploration."""

    phase: ExplorePhase = ExplorePhase.LOOK
    to_turn_rad: float = FIRST_LOOK_RAD
    """Remaining angle of the turn, in LOOK, rad."""
    last_yaw_rad: float | None = None
    here_ne_m: Vector2 | None = None
    """Place of the turn, or of waiting in CHOOSE, local NED, m."""
    clockwise: bool = True
    """Direction of the turn."""
    ground: CostGrid | None = None
    """Cost grid, in CHOOSE, once it is computed."""
    ways: ShortestPaths | None = None
    """Shortest paths from here, in CHOOSE, once they are computed."""
    looks: tuple[Viewpoint, ...] = ()
    """Viewpoints to select from, in CHOOSE, once they are computed."""
    travel: Travel | None = None
    """Journey to the viewpoint, in GO, or out of the way, in WAIT; in CHOOSE, the journey that
    continues meanwhile."""
    look: Viewpoint | None = None
    """The next or present viewpoint; None for the first turn."""
    tried: tuple[Viewpoint, ...] = ()
    """All viewpoints so far, with those seen from the path and those not reached."""
    came: Travel | None = None
    """The last journey."""
    checked_s: float = 0.0
    """Time of the last check of the targets, s; in WAIT, of its begin."""
    arrives_s: float = 0.0
    """Expected time of arrival at the viewpoint, s; later if the drone has to wait on its way."""

    def rested(self) -> "Explore":
        """The state after a pause: the time without progress begins anew."""
        return replace(self, travel=self.travel and self.travel.rested())

    @property
    def known_doorways(self) -> tuple[Doorway, ...]:
        """All doorways found so far."""
        last = self.travel or self.came
        return () if last is None else last.known

    def shut(self, space: Occupancy) -> tuple[Doorway, ...]:
        """Doorways that are too narrow, and places where the drone was stuck twice."""
        last = self.travel or self.came
        stuck = () if last is None else stuck_twice(last)
        return (*too_narrow(self.known_doorways, space), *stuck)

    @property
    def is_extra(self) -> bool:
        """True if everything reachable was seen once. The rest of the mission may end early."""
        looked = self.tried if self.look is None else (*self.tried, self.look)
        return any(look.is_extra for look in looked)

    @property
    def activity(self) -> str:
        """Description of the phase, or of a sweep or a withdrawal in it."""
        if self.travel and self.travel.phase in (TravelPhase.SWEEP, TravelPhase.WITHDRAW):
            return str(self.travel.phase.value)
        if self.phase is ExplorePhase.GO and self.look is not None and self.look.is_tie:
            return "going to look again at walls that are not known well"
        return str(self.phase.value)


def step(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    """Runs one tick. Returns the next state and the velocity setpoint."""
    match explore.phase:
        case ExplorePhase.LOOK:
            return _look(explore, observation, space, plan)
        case ExplorePhase.CHOOSE:
            chosen = _choose(explore, observation, space, plan)
            return chosen, _meanwhile(explore, observation, space, plan)
        case ExplorePhase.GO:
            return _go(explore, observation, space, plan)
        case ExplorePhase.WAIT:
            return _wait(explore, observation, space, plan)
        case ExplorePhase.DONE:
            return explore, HOLD


def _wait(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    if explore.travel is not None:
        going, setpoint = travel.step(explore.travel, observation, space, plan)
        explore = replace(explore, travel=going)
        if going.phase in (TravelPhase.ARRIVED, TravelPhase.GAVE_UP):
            return _waits(explore, observation.pose), HOLD
        return explore, setpoint
    here = explore.here_ne_m or observation.pose.ne_m
    is_over = not is_more_expected(observation.claims)
    if is_over or observation.pose.time_s - explore.checked_s > WAIT_S:
        explore = replace(_to_choose(explore, None), here_ne_m=here)
    return explore, stay(here, observation.pose)


def _look(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    yaw_rad, now_s = observation.pose.yaw_rad, observation.pose.time_s
    last_rad = yaw_rad if explore.last_yaw_rad is None else explore.last_yaw_rad
    left_rad = explore.to_turn_rad - abs(wrap_rad(yaw_rad - last_rad))
    here = explore.here_ne_m or observation.pose.ne_m
    explore = replace(explore, to_turn_rad=left_rad, last_yaw_rad=yaw_rad, here_ne_m=here)
    look = explore.look
    is_enough = left_rad <= 0 or observation.is_gap_doubtful
    if look and now_s - explore.checked_s > CHECK_S:
        explore = replace(explore, checked_s=now_s)
        is_enough = is_enough or not _left_of(look, space)
    gliding = glide(here, observation.pose, GLIDE_SHARE * plan.speed_m_s, observation.lag_s)
    if is_enough:
        return replace(_to_choose(explore, look), here_ne_m=here), gliding
    rate_rad_s = math.copysign(math.radians(plan.turn_rate_deg_s), 1 if explore.clockwise else -1)
    return explore, replace(gliding, yaw_rate_rad_s=rate_rad_s)


def _to_look(
    explore: Explore, look: Viewpoint, at: Travel, observation: Observation, space: Occupancy
) -> Explore:
    left = _left_of(look, space)
    if not left:
        return replace(_to_choose(explore, look), travel=replace(at, within_m=ARRIVED_M))
    turn_rad = _turn_rad(left, at.goal_ne_m, observation.pose.yaw_rad)
    enough_rad = MAX_LOOK_RAD if look.is_tie else abs(turn_rad) + PAST_RAD
    return Explore(
        ExplorePhase.LOOK,
        min(enough_rad, MAX_LOOK_RAD),
        here_ne_m=at.goal_ne_m,
        clockwise=turn_rad >= 0,
        look=look,
        tried=explore.tried,
        came=at,
    )


def _left_of(look: Viewpoint, space: Occupancy) -> Places:
    """The viewpoint's targets that are still unseen; all, if it measures walls again."""
    if look.is_tie:
        return look.at_ne_m
    return still_unseen(space, look.at_ne_m, look.least_surface)


def _turn_rad(places: Places, from_ne_m: Vector2, yaw_rad: float) -> float:
    """Angle by which the drone must turn until a front or side beam has swept each place, rad.

    The direction is the shorter one; clockwise is positive.
    """
    north_m, east_m = (np.array(places) - from_ne_m).T
    off_rad = (np.arctan2(east_m, north_m) - yaw_rad)[:, None] - SIDES_RAD
    clockwise_rad = float((off_rad % math.tau).min(axis=1).max(initial=0))
    other_way_rad = float((-off_rad % math.tau).min(axis=1).max(initial=0))
    return clockwise_rad if clockwise_rad <= other_way_rad else -other_way_rad


def _to_choose(explore: Explore, ended: Viewpoint | None) -> Explore:
    """Enters CHOOSE, and records the viewpoint that ended, if any."""
    tried = explore.tried if ended is None else (*explore.tried, ended)
    last = explore.travel or explore.came
    came = None if last is None else replace(last, course=None)
    return Explore(ExplorePhase.CHOOSE, tried=tried, came=came)


def _choose(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> Explore:
    """Runs one of four steps per tick, because each can take much of a tick's time.

    The steps are cost grid, shortest paths, viewpoints, and the first viewpoint of the tour.
    """
    if explore.ground is None:
        here = observation.pose.ne_m
        ground = find_ground(space, here, clear_of_all_m(plan))
        return replace(explore, ground=with_shut(ground, explore.shut(space)))
    if explore.ways is None:
        return replace(explore, ways=find_ways(explore.ground))
    if not explore.looks:
        if left := _unclaimed(explore.ways, explore.tried, observation, plan):
            return replace(explore, looks=left)
        if is_more_expected(observation.claims):
            return _to_wait(explore, explore.ways, observation)
        return replace(explore, phase=ExplorePhase.DONE)
    found = explore.looks
    if plan.kind == "exterior":
        found = on_own_side(found, explore.ways, observation.explorers_ne_m)
    places = tuple(look.from_ne_m for look in found)
    look = found[first_of_tour(explore.ways, places, START_NE_M)]
    going = onward(explore.travel or explore.came, look.from_ne_m, NEAR_ENOUGH_M)
    return Explore(
        ExplorePhase.GO,
        travel=travel.along(explore.ways, going, observation),
        look=look,
        tried=explore.tried,
        checked_s=observation.pose.time_s,
        arrives_s=observation.pose.time_s + _arrives_in_s(explore.ways, look, plan),
    )


def _unclaimed(
    ways: ShortestPaths,
    tried: tuple[Viewpoint, ...],
    observation: Observation,
    plan: MissionConfig,
) -> tuple[Viewpoint, ...]:
    """The viewpoints that are not left to a teammate: of unseen targets, or else of walls.

    So a drone measures walls again while its teammates look at all that is unseen.
    """
    for search in (looks, ties, again):
        left = tuple(
            look
            for look in search(ways, observation, plan, tried)
            if not is_claimed(look, _arrives_in_s(ways, look, plan), observation.claims)
        )
        if left:
            return left
    return ()


def _arrives_in_s(ways: ShortestPaths, look: Viewpoint, plan: MissionConfig) -> float:
    """Expected time to a viewpoint, s."""
    return float(ways.metres[ways.ground.grid.cell(look.from_ne_m)]) / plan.speed_m_s


def _to_wait(explore: Explore, ways: ShortestPaths, observation: Observation) -> Explore:
    """Enters WAIT, where the drone is or at the nearest place where others can pass."""
    pose, waits = observation.pose, _waits(explore, observation.pose)
    place = out_of_the_way(ways, explore.known_doorways)
    if place is None or math.dist(place, pose.ne_m) < ASIDE_M:
        return waits
    going = onward(explore.travel or explore.came, place, ARRIVED_M)
    return replace(waits, travel=travel.along(ways, going, observation))


def _waits(explore: Explore, pose: Pose) -> Explore:
    """Waits where the drone is."""
    return replace(
        _to_choose(explore, None),
        phase=ExplorePhase.WAIT,
        here_ne_m=pose.ne_m,
        checked_s=pose.time_s,
    )


def _meanwhile(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> Setpoint:
    """Setpoint in CHOOSE: the drone continues to fly, so that it does not stop each time."""
    if explore.travel is not None:
        going, setpoint = travel.step(explore.travel, observation, space, plan)
        return setpoint if going.phase is TravelPhase.FLY else HOLD
    if explore.here_ne_m is not None:
        return glide(
            explore.here_ne_m, observation.pose, GLIDE_SHARE * plan.speed_m_s, observation.lag_s
        )
    return HOLD


def _go(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    going, look, now_s = explore.travel, explore.look, observation.pose.time_s
    if going is None or look is None:
        return _to_choose(explore, None), HOLD
    is_due = going.phase is TravelPhase.FLY and now_s - explore.checked_s > CHECK_S
    if is_due:
        least_s = going.left_m(observation.pose.ne_m) / plan.speed_m_s
        explore = replace(explore, arrives_s=max(explore.arrives_s, now_s + least_s))
    if is_due and travel.in_the_open(observation, space):
        left = _left_of(look, space)
        explore = replace(explore, checked_s=now_s)
        if is_claimed(look, explore.arrives_s - now_s, observation.claims):
            chooses = replace(_to_choose(explore, None), travel=going)
            return chooses, _meanwhile(chooses, observation, space, plan)
        if len(left) < WORTH_SHARE * len(look.at_ne_m):
            seen = tuple(place for place in look.at_ne_m if place not in left)
            chooses = replace(_to_choose(explore, replace(look, at_ne_m=seen)), travel=going)
            return chooses, _meanwhile(chooses, observation, space, plan)
    before = going
    going, setpoint = travel.step(going, observation, space, plan)
    match going.phase:
        case TravelPhase.ARRIVED:
            return _to_look(explore, look, before, observation, space), setpoint
        case TravelPhase.GAVE_UP:
            return _to_choose(replace(explore, travel=going), look), setpoint
        case _:
            return replace(explore, travel=going), setpoint
