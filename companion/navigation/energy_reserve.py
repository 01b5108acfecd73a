"""Decides when the drone must return, from remaining time and battery and the time to fly home.

In a team a drone must also be home before one flies on that does not hear it.

The path home is computed only when the result can matter. Since the last computation it has grown
by no more than the distance flown since.
"""

import math
from dataclasses import replace
from itertools import pairwise
from statistics import fmean

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.values import value
from companion.mapping.occupancy import Occupancy
from companion.navigation.doorways import find_doorways
from companion.navigation.grid_planner import (
    START_NE_M,
    ShortestPaths,
    find_ground,
    find_ways,
    retraced,
)
from companion.navigation.observation import Observation
from companion.navigation.path_follower import Way, most_speed_m_s
from companion.safety.obstacle_memory import AMONG_LEGS_S, FURNISHED_LEGS
from companion.safety.velocity_guard import clear_of_all_m

ASK_AGAIN_S = 5.0
"""Minimum time between two computations of the path home, s. Chosen."""
SPEED_SHARE, DOORWAY_S, TURNS_S = 0.75, 14.0, 10.0
"""Model of the time to fly a path: mean speed as a share of the speed limit, time for each doorway,
s, and time for the turns at both ends, s."""
ROUGHLY = 1.1
"""Safety factor on the computed time. Flights out of a maze took 5 % more than computed."""
AMONG_LEGS_MEAN_M_S, AMONG_LEGS_PRIOR_S = 0.15, 150.0
"""Initial mean speed on journeys among legs, m/s, and its weight, s. `benchmarks/flight/legs.py`
measures 0.27 m/s on a straight path. Five flights in clutter went home at 0.10 to 0.20 m/s with
sweeps, and two explored at 0.08 and 0.15 m/s. So a flight's own journeys correct the mean. The
weight is chosen."""
STEP_M = 0.3
"""Spacing of the places where a path's clearance is evaluated, and of those between which a flown
path is measured, m. Chosen."""
UNKNOWN_SPEED_SHARE = 0.4
"""Mean speed, as a share of the planned speed, on the straight line home without a known path; also
bounds the growth of the time home since its last computation. Chosen."""
RATE_KNOWN_S = 30.0
"""Minimum window to estimate the discharge rate, s. The battery is reported in whole percent, about
one in 6 s."""
NOTED_S = 5.0
"""Minimum time between two battery records, s. Chosen."""


@value
class Spent:
    """Time and battery used so far."""

    flown_s: float
    """Time since the start, s."""
    battery: float | None
    """Remaining charge, 0 to 1; None if the autopilot does not report it."""


@value
class Pace:
    """Mean speed on journeys among legs, with sweeps and stops."""

    at_ne_m: Vector2 | None = None
    """Place up to which the present journey counts, local NED, m; None between journeys."""
    at_s: float = 0.0
    """Time of the last tick of the journey, s after the start."""
    flown_m: float = AMONG_LEGS_MEAN_M_S * AMONG_LEGS_PRIOR_S
    flown_s: float = AMONG_LEGS_PRIOR_S
    """Length, m, and time, s, of all journeys so far, from the initial mean on."""

    @property
    def mean_m_s(self) -> float:
        """Mean speed, at most the initial one, m/s."""
        return min(AMONG_LEGS_MEAN_M_S, self.flown_m / self.flown_s)

    def onward(self, now_s: float, observation: Observation, *, travels: bool) -> "Pace":
        """Add a tick. `travels`: the drone is on a journey to a viewpoint.

        The path is summed in steps of `STEP_M`: the sway of a slow drone is no progress.
        """
        if not (travels and observation.is_among_legs):
            return self if self.at_ne_m is None else replace(self, at_ne_m=None)
        here = observation.pose.ne_m
        if self.at_ne_m is None:
            return replace(self, at_ne_m=here, at_s=now_s)
        flown_s = self.flown_s + now_s - self.at_s
        step_m = math.dist(here, self.at_ne_m)
        if step_m < STEP_M:
            return replace(self, at_s=now_s, flown_s=flown_s)
        return Pace(here, now_s, self.flown_m + step_m, flown_s)


@value
class Reserve:
    """State: the time to fly home, the battery records, and the pace among legs."""

    noted: tuple[Spent, ...] = ()
    """Battery records of the second half of the flight so far, and one before it."""
    way_home_s: float = TURNS_S
    """Time to fly home at the last computation, s."""
    asked_s: float = 0.0
    """Time of the last computation, s after the start."""
    pace: Pace = Pace()
    """Journeys among legs so far."""


def step(
    reserve: Reserve,
    spent: Spent,
    observation: Observation,
    space: Occupancy,
    plan: MissionConfig,
    *,
    travels: bool,
) -> tuple[Reserve, str]:
    """Runs one tick. Returns the next state and the reason to return now, empty without one.

    `travels`: the drone is on a journey to a viewpoint.
    """
    flown_s = spent.flown_s
    reserve = _noted(reserve, spent)
    pace = reserve.pace.onward(flown_s, observation, travels=travels)
    if pace is not reserve.pace:
        reserve = replace(reserve, pace=pace)
    parted_s = observation.home_by_s - observation.pose.time_s - plan.reserve_s
    parted = parted_s, "before a drone flies on that does not hear this one"
    left_s, why = min(_left_s(reserve, spent, plan), parted)
    since_s = flown_s - reserve.asked_s
    if left_s > ROUGHLY * reserve.way_home_s + since_s / UNKNOWN_SPEED_SHARE:
        return reserve, ""
    if since_s > ASK_AGAIN_S:
        way_home_s = _way_home_s(observation, space, plan, reserve.pace)
        reserve = replace(reserve, asked_s=flown_s, way_home_s=way_home_s)
    return reserve, "" if left_s > ROUGHLY * reserve.way_home_s else why


def _noted(reserve: Reserve, spent: Spent) -> Reserve:
    noted = reserve.noted
    if spent.battery is None or (noted and spent.flown_s < noted[-1].flown_s + NOTED_S):
        return reserve
    while len(noted) > 1 and noted[1].flown_s < spent.flown_s / 2:
        noted = noted[1:]
    return replace(reserve, noted=(*noted, spent))


def _left_s(reserve: Reserve, spent: Spent, plan: MissionConfig) -> tuple[float, str]:
    """Remaining time until the drone must be home, s, and the limit that applies.

    The discharge rate is that of the second half of the flight so far. An estimate from the voltage
    also drops under the load of the take-off, which the second half excludes.
    """
    flown_s, battery = spent.flown_s, spent.battery
    by_limit_s = plan.time_limit_s - flown_s - plan.reserve_s
    limit = by_limit_s, f"for the limit of {plan.time_limit_s:.0f} s"
    if battery is None or flown_s < 2 * RATE_KNOWN_S:
        return limit
    then = reserve.noted[0]
    window_s, used = flown_s - then.flown_s, (then.battery or 0.0) - battery
    if window_s < RATE_KNOWN_S or used <= 0:
        return limit
    share_left = battery - 0.01 * plan.battery_land_percent
    by_battery_s = window_s * share_left / used - plan.reserve_s
    return min(limit, (by_battery_s, f"with {100 * battery:.0f} % of the battery"))


def _way_home_s(
    observation: Observation, space: Occupancy, plan: MissionConfig, pace: Pace
) -> float:
    """Time to fly home, s. With few legs, the drone is slow for a while at each of them."""
    here = observation.pose.ne_m
    ground = find_ground(space, here, clear_of_all_m(plan))
    ways = find_ways(ground)
    if not ways.reaches(START_NE_M):
        ways = find_ways(retraced(ground))
    if not ways.reaches(START_NE_M):
        return TURNS_S + math.dist(here, START_NE_M) / (UNKNOWN_SPEED_SHARE * plan.speed_m_s)
    way = ways.to(START_NE_M)
    doorways = find_doorways(ways.ground, here, way)
    among_legs_s = _flown_s(ways, here, way, plan, pace.mean_m_s)
    if observation.legs < FURNISHED_LEGS:
        in_the_open_s = _flown_s(ways, here, way, plan, plan.speed_m_s)
        among_legs_s = min(among_legs_s, in_the_open_s + AMONG_LEGS_S * observation.legs)
    return TURNS_S + among_legs_s + DOORWAY_S * len(doorways)


def _flown_s(
    ways: ShortestPaths, here: Vector2, way: Way, plan: MissionConfig, most_m_s: float
) -> float:
    """Time to fly a path, s, with the speed limit from its clearance."""
    flown_s = 0.0
    for start, end in pairwise((here, *way)):
        length_m = math.dist(start, end)
        places = np.linspace(start, end, 1 + math.ceil(length_m / STEP_M)).tolist()
        room_m = (ways.ground.clear_m((north, east)) for north, east in places)
        wide_m_s = (SPEED_SHARE * most_speed_m_s(metres, plan) for metres in room_m)
        speeds_m_s = [min(speed, most_m_s) for speed in wide_m_s]
        flown_s += length_m * fmean(1 / speed for speed in speeds_m_s)
    return flown_s
