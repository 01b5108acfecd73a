"""Seeing everything that can be reached: look round, go to where most is unseen, again.

          turned, or            something unseen can be reached,
          all of it seen        or else a wall is not known well
    LOOK ────────────────► CHOOSE ──────────────► GO
     ▲                      │   ▲                 │ │
     │          nothing is  │   └─────────────────┘ │
     │                      ▼     no way, or it was │
     │                     DONE   seen from the way │
     └──────────────────────────────────────────────┘
              nearly there, and some is still unseen

It hardly stops. The swing of its nose shows what lies ahead and beside the way; it turns for the
rest while it goes the last metres, only as far as one of three beams has to, and chooses while it
goes on.

Safety: it goes only where `travel` goes, through cells that beams have found free, and the last
metres straight.
"""

import enum
import math
from dataclasses import dataclass, replace

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2, wrap_rad
from companion.core.messages import BEARING_FRD_RAD, HOLD, Beam, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.navigation import travel
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
from companion.pdps.frontiers import Places, still_unseen
from companion.pdps.loop_views import again, ties
from companion.pdps.tour import first_of_tour
from companion.pdps.viewpoints import Viewpoint, looks
from companion.safety.control_laws import glide
from companion.safety.velocity_guard import clear_of_all_m

FIRST_LOOK_RAD = math.tau
MAX_LOOK_RAD = math.pi + math.radians(10)
PAST_RAD = math.radians(15)
"""So far it turns on when a beam has passed over all that it has come for."""
SIDES_RAD = np.array([BEARING_FRD_RAD[beam] for beam in (Beam.LEFT, Beam.FRONT, Beam.RIGHT)])
NEAR_ENOUGH_M = 2.0
"""So near to where it wants to look from it begins to turn, and goes there meanwhile."""
GLIDE_SHARE = 0.6
"""Of its speed: its nose points elsewhere meanwhile."""
CHECK_S = 1.0
"""So often it is asked whether what it looks for is still unseen."""
WORTH_SHARE = 0.35
"""When less than this of it is left, there may be a better place to go to."""


class ExplorePhase(enum.Enum):
    """Where in the diagram above."""

    LOOK = "looking round"
    CHOOSE = "choosing where to look from"
    GO = "going to where something is unseen"
    DONE = "all that can be reached was seen"


@dataclass(frozen=True, slots=True)
class Explore:
    """The exploration's whole memory."""

    phase: ExplorePhase = ExplorePhase.LOOK
    to_turn_rad: float = FIRST_LOOK_RAD
    last_yaw_rad: float | None = None
    here_ne_m: Vector2 | None = None
    """Where it turns round, or waits while it chooses,"""
    clockwise: bool = True
    """and which way it turns."""
    ground: CostGrid | None = None
    """In CHOOSE: where it fits, once that is found,"""
    ways: ShortestPaths | None = None
    """all ways from here,"""
    looks: tuple[Viewpoint, ...] = ()
    """and then from where to look."""
    travel: Travel | None = None
    """In GO; and in CHOOSE, if there was no need to stop."""
    look: Viewpoint | None = None
    """The next, or the present one; None at the first."""
    tried: tuple[Viewpoint, ...] = ()
    """All looks so far, also those that were seen from the way, or not come to."""
    came: Travel | None = None
    """How it has come here."""
    checked_s: float = 0.0

    @property
    def known_doorways(self) -> tuple[Doorway, ...]:
        """All found so far."""
        last = self.travel or self.came
        return () if last is None else last.known

    def shut(self, space: Occupancy) -> tuple[Doorway, ...]:
        """What is too narrow, and where it was stuck."""
        last = self.travel or self.came
        stuck = () if last is None else stuck_twice(last)
        return (*too_narrow(self.known_doorways, space), *stuck)

    @property
    def is_extra(self) -> bool:
        """All that can be reached was seen once, and what goes on is not worth the last battery."""
        looked = self.tried if self.look is None else (*self.tried, self.look)
        return any(look.is_extra for look in looked)

    @property
    def activity(self) -> str:
        """The phase in words, as fine as it is known."""
        if self.travel is not None and self.travel.phase is TravelPhase.SWEEP:
            return TravelPhase.SWEEP.value
        if self.phase is ExplorePhase.GO and self.look is not None and self.look.is_tie:
            return "going to look again at walls that are not known well"
        return str(self.phase.value)


def step(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    """One tick: the next state and the velocity to fly."""
    match explore.phase:
        case ExplorePhase.LOOK:
            return _look(explore, observation, space, plan)
        case ExplorePhase.CHOOSE:
            chosen = _choose(explore, observation, space, plan)
            return chosen, _meanwhile(explore, observation, space, plan)
        case ExplorePhase.GO:
            return _go(explore, observation, space, plan)
        case ExplorePhase.DONE:
            return explore, HOLD


def _look(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Explore, Setpoint]:
    yaw_rad, now_s = observation.pose.yaw_rad, observation.pose.time_s
    last_rad = yaw_rad if explore.last_yaw_rad is None else explore.last_yaw_rad
    left_rad = explore.to_turn_rad - abs(wrap_rad(yaw_rad - last_rad))
    here = explore.here_ne_m or observation.pose.ne_m
    explore = replace(explore, to_turn_rad=left_rad, last_yaw_rad=yaw_rad, here_ne_m=here)
    look, is_enough = explore.look, left_rad <= 0
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
    """What is still to be seen of it; walls are looked at again only from there."""
    if look.is_tie:
        return look.at_ne_m
    return still_unseen(space, look.at_ne_m, look.least_surface)


def _turn_rad(places: Places, from_ne_m: Vector2, yaw_rad: float) -> float:
    """Until one of the beams to the front and sides has passed over each of the places.

    The shorter way round; clockwise is positive.
    """
    north_m, east_m = (np.array(places) - from_ne_m).T
    off_rad = (np.arctan2(east_m, north_m) - yaw_rad)[:, None] - SIDES_RAD
    clockwise_rad = float((off_rad % math.tau).min(axis=1).max(initial=0))
    other_way_rad = float((-off_rad % math.tau).min(axis=1).max(initial=0))
    return clockwise_rad if clockwise_rad <= other_way_rad else -other_way_rad


def _to_choose(explore: Explore, ended: Viewpoint | None) -> Explore:
    """A look is over, or there will be none."""
    tried = explore.tried if ended is None else (*explore.tried, ended)
    last = explore.travel or explore.came
    came = None if last is None else replace(last, course=None)
    return Explore(ExplorePhase.CHOOSE, tried=tried, came=came)


def _choose(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> Explore:
    """Four steps, a tick each: any may take a good part of it."""
    if explore.ground is None:
        here = observation.pose.ne_m
        ground = find_ground(space, here, clear_of_all_m(plan))
        return replace(explore, ground=with_shut(ground, explore.shut(space)))
    if explore.ways is None:
        return replace(explore, ways=find_ways(explore.ground))
    if not explore.looks:
        found = looks(explore.ways, observation, plan, explore.tried)
        found = found or ties(explore.ways, observation, plan, explore.tried)
        found = found or again(explore.ways, observation, plan, explore.tried)
        if not found:
            return replace(explore, phase=ExplorePhase.DONE)
        return replace(explore, looks=found)
    places = tuple(look.from_ne_m for look in explore.looks)
    look = explore.looks[first_of_tour(explore.ways, places, START_NE_M)]
    going = onward(explore.travel or explore.came, look.from_ne_m, NEAR_ENOUGH_M)
    return Explore(
        ExplorePhase.GO,
        travel=travel.along(explore.ways, going, observation),
        look=look,
        tried=explore.tried,
        checked_s=observation.pose.time_s,
    )


def _meanwhile(
    explore: Explore, observation: Observation, space: Occupancy, plan: MissionConfig
) -> Setpoint:
    """It goes on until it has chosen, or it would stop every time."""
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
    if is_due and travel.in_the_open(observation, space):
        left = _left_of(look, space)
        explore = replace(explore, checked_s=now_s)
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
