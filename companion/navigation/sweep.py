"""Turns the drone on the spot through a list of headings, so that the beams sweep a sector.

    to the first heading ─► to the next ─► … ─► done

The sweep goes all round, or over both jambs of a doorway. Over the jambs the drone turns slowly,
and the detections of the front beam are recorded.
"""

import math
from dataclasses import dataclass, replace

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2, along, wrap_rad
from companion.core.messages import Beam, Setpoint
from companion.navigation.doorways import Doorway
from companion.navigation.observation import Observation
from companion.safety.control_laws import stay, turn_towards

BESIDE_JAMB_RAD, SLOWLY_RAD_S = math.radians(15), math.radians(25)
"""Margin beyond either jamb, rad, and yaw rate of the sweep, rad/s. Chosen: the rate gives a
reading every few centimetres."""
AT_PLACE_M = 0.5
"""Maximum distance to the place of the sweep at which a step of the pose is applied to it, m.
Chosen: a step of the pose is smaller."""
ON_HEADING_RAD = math.radians(5)
"""Maximum error at which a heading counts as reached, rad. Chosen."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """State of a sweep."""

    headings_rad: tuple[float, ...]
    """Headings still to turn to, rad; the sweep is done if there is none."""
    stay_ne_m: Vector2
    """Position to hold, local NED, m."""
    resets: int
    """Reset counter of the pose at the last tick."""
    doorway: Doorway | None = None
    """The doorway that is swept; None for a sweep all round."""
    met_ne_m: tuple[Vector2, ...] = ()
    """Detections of the front beam on the doorway, local NED, m."""

    @property
    def is_done(self) -> bool:
        return not self.headings_rad


def all_round(observation: Observation, stay_ne_m: Vector2) -> Sweep:
    """A sweep all round. It has three headings, because a turn takes the shorter direction."""
    thirds = (observation.pose.yaw_rad + third * math.tau / 3 for third in (1, 2, 3))
    return Sweep(tuple(thirds), stay_ne_m, observation.pose.reset_counter)


def over_jambs(doorway: Doorway, observation: Observation) -> Sweep:
    """A sweep over a doorway's jambs, from beyond the right one to beyond the left one."""
    here = observation.pose.ne_m
    left_rad, right_rad = (
        math.atan2(east_m - here[1], north_m - here[0]) for north_m, east_m in doorway.jambs_ne_m()
    )
    headings_rad = right_rad + BESIDE_JAMB_RAD, left_rad - BESIDE_JAMB_RAD
    swept = replace(doorway, swept_s=observation.pose.time_s)
    return Sweep(headings_rad, here, observation.pose.reset_counter, swept)


def step(sweep: Sweep, observation: Observation, plan: MissionConfig) -> tuple[Sweep, Setpoint]:
    """Runs one tick. Returns the next state and the velocity setpoint."""
    if observation.pose.reset_counter != sweep.resets:  # the drone itself has not moved
        sweep = _as_posed(sweep, observation)
    holding = stay(sweep.stay_ne_m, observation.pose)
    heading_rad, *later = sweep.headings_rad
    if abs(wrap_rad(heading_rad - observation.pose.yaw_rad)) <= ON_HEADING_RAD:
        return replace(sweep, headings_rad=tuple(later)), holding
    if not later:
        sweep = replace(sweep, met_ne_m=(*sweep.met_ne_m, *_met_ahead(observation)))
    most_rad_s = math.radians(plan.turn_rate_deg_s) if later else SLOWLY_RAD_S
    rate_rad_s = turn_towards(heading_rad, observation.pose.yaw_rad, most_rad_s)
    return sweep, replace(holding, yaw_rate_rad_s=rate_rad_s)


def _as_posed(sweep: Sweep, observation: Observation) -> Sweep:
    """Moves the sweep's place and detections with a step of the pose.

    If the drone is not yet at the place, only the reset counter changes.
    """
    sweep = replace(sweep, resets=observation.pose.reset_counter)
    here = observation.pose.ne_m
    north_m, east_m = here[0] - sweep.stay_ne_m[0], here[1] - sweep.stay_ne_m[1]
    if math.hypot(north_m, east_m) >= AT_PLACE_M:
        return sweep
    met_ne_m = tuple((north + north_m, east + east_m) for north, east in sweep.met_ne_m)
    return replace(sweep, stay_ne_m=here, met_ne_m=met_ne_m)


def _met_ahead(observation: Observation) -> tuple[Vector2, ...]:
    reading = observation.ranges.get(Beam.FRONT)
    if reading is None or not reading.is_distance:
        return ()
    away_m = reading.distance_m + observation.mount_offset_m
    bearing_rad = observation.pose.yaw_rad + observation.bearings_frd_rad[Beam.FRONT]
    return (along(observation.pose.ne_m, bearing_rad, away_m),)
