"""Lists what a survey has not seen yet, as the next flight will find it."""

import math
from dataclasses import dataclass

import numpy as np

from companion.config.settings import Config
from companion.core.frames import Vector2
from companion.core.messages import Beam, Pose
from companion.drivers.models import range_models
from companion.earlier import EarlierFlights
from companion.mapping.occupancy import CELL_M
from companion.navigation.grid_planner import START_NE_M, find_ground, find_ways
from companion.navigation.observation import Observation
from companion.navigation.standoff import standoff_m
from companion.pdps.frontiers import frontiers
from companion.pdps.viewpoints import looks
from companion.safety.velocity_guard import clear_of_all_m


@dataclass(frozen=True, slots=True)
class Left:
    """What is left to see from places that the drone can reach."""

    places_ne_m: tuple[Vector2, ...]
    """Places to look from, in the frame of the survey, m."""
    edge_m: float
    """Length of the edge between seen and unseen space, m."""
    flight_s: float
    """Time to fly to each of the places and home again, one after the other, s: an upper limit."""

    def in_words(self) -> str:
        """One line for the user."""
        if not self.places_ne_m:
            return "nothing that can be reached is left"
        return (
            f"left: {len(self.places_ne_m)} places to look from, {self.edge_m:.1f} m of edge to "
            f"unseen space, at most {math.ceil(self.flight_s / 60)} min"
        )


def left_to_fly(earlier: EarlierFlights, config: Config) -> Left:
    """What the next flight would look at, by the rules of the mission "building"."""
    plan, sensors = config.mission, config.sensors
    front = range_models(sensors)[Beam.FRONT]
    at_home = Observation(
        Pose(0.0, *START_NE_M, 0.0, 0.0),
        {},
        sensors.mount_offset_m,
        standoff_m(plan.standoff, front, sensors.mount_offset_m),
    )
    tried = earlier.begin().building.tried
    ways = find_ways(find_ground(earlier.space, START_NE_M, clear_of_all_m(plan)))
    viewpoints = looks(ways, at_home, plan, tried)
    places = tuple(each.from_ne_m for each in viewpoints if not each.is_extra)
    if not places:
        return Left((), 0.0, 0.0)
    away_m = [float(ways.metres[ways.ground.grid.cell(place)]) for place in places]
    edge_m = CELL_M * int(np.count_nonzero(frontiers(earlier.space)))
    return Left(places, edge_m, 2 * sum(away_m) / plan.speed_m_s)
