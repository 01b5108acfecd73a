"""Lists what a survey has not seen yet, as the next flight will find it."""

import math
from dataclasses import dataclass

import numpy as np

from companion.config.settings import Config, MissionConfig
from companion.core.frames import Vector2
from companion.core.messages import Beam, Pose
from companion.drivers.models import range_models
from companion.earlier import EarlierFlights
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.navigation.grid_planner import START_NE_M, find_ground, find_ways
from companion.navigation.observation import Observation
from companion.navigation.standoff import standoff_m
from companion.pdps.frontiers import frontiers
from companion.pdps.layers import fits_above, layer_height_m
from companion.pdps.viewpoints import looks
from companion.safety import fence
from companion.safety.velocity_guard import clear_of_all_m

NEAR_START_M, NEAR_HEIGHT_M = 0.5, 0.15
"""The up beam measures the room above the start within these distances of the start and of the
layer's height, m. Chosen."""


@dataclass(frozen=True, slots=True)
class Left:
    """What is left to see from places that the drone can reach."""

    places_ne_m: tuple[Vector2, ...]
    """Places to look from, in the frame of the survey, m."""
    edge_m: float
    """Length of the edge between seen and unseen space, m."""
    flight_s: float
    """Time to fly to each of the places and home again, one after the other, s: an upper limit."""
    is_higher_left: bool = False
    """In the mission "layers": a higher layer fits above the start, and no flight has begun it."""

    @property
    def is_nothing(self) -> bool:
        """True if all that can be reached was seen."""
        return not self.places_ne_m and not self.is_higher_left

    def in_words(self) -> str:
        """One line for the user."""
        if self.is_nothing:
            return "nothing that can be reached is left"
        left = []
        if self.places_ne_m:
            places = "1 place" if len(self.places_ne_m) == 1 else f"{len(self.places_ne_m)} places"
            left.append(
                f"{places} to look from, {self.edge_m:.1f} m of edge to "
                f"unseen space, at most {math.ceil(self.flight_s / 60)} min"
            )
        if self.is_higher_left:
            left.append("the layers above")
        return f"left: {'; '.join(left)}"


def left_to_fly(earlier: EarlierFlights, config: Config) -> Left:
    """What the next flight would look at in each layer, by the rules of the mission "building"."""
    plan, sensors = config.mission, config.sensors
    front = range_models(sensors)[Beam.FRONT]
    at_home = Observation(
        Pose(0.0, *START_NE_M, 0.0, 0.0),
        {},
        sensors.mount_offset_m,
        standoff_m(plan.standoff, front, sensors.mount_offset_m),
    )
    places: list[Vector2] = []
    away_m = edge_m = 0.0
    for space, tried in zip(_spaces(earlier, plan), earlier.viewpoints, strict=True):
        clear_m = clear_of_all_m(plan)
        fenced = fence.inside(space, START_NE_M, plan, clear_m)
        ways = find_ways(find_ground(fenced, START_NE_M, clear_m))
        viewpoints = looks(ways, at_home, plan, tried)
        left = [each.from_ne_m for each in viewpoints if not each.is_extra]
        away_m += sum(float(ways.metres[ways.ground.grid.cell(place)]) for place in left)
        edge_m += CELL_M * int(np.count_nonzero(frontiers(space))) if left else 0.0
        places += left
    is_higher_left = plan.kind == "layers" and _fits_above(earlier, config)
    return Left(tuple(places), edge_m, 2 * away_m / plan.speed_m_s, is_higher_left)


def _fits_above(earlier: EarlierFlights, config: Config) -> bool:
    """True if the up beam measured room for another layer above the start, or nothing at all."""
    plan, mount_m = config.mission, config.sensors.mount_offset_m
    north_m, east_m, at_m, above_m = earlier.overhead.T
    number = len(earlier.spaces) - 1
    height_m = layer_height_m(number, plan) + mount_m
    is_there = np.hypot(north_m - START_NE_M[0], east_m - START_NE_M[1]) < NEAR_START_M
    is_there &= np.abs(at_m - height_m) < NEAR_HEIGHT_M
    if not is_there.any():
        return fits_above(math.inf, number, plan)
    ceiling_m = float(np.median((at_m + above_m)[is_there]))
    return fits_above(ceiling_m - height_m + mount_m, number, plan)


def _spaces(earlier: EarlierFlights, plan: MissionConfig) -> list[Occupancy]:
    """The space of each layer of the mission that a flight has begun."""
    spaces = [earlier.spaces[0]]
    if plan.kind == "layers":
        for known in earlier.spaces[1:]:
            spaces.append(spaces[-1].layer_above((), known))
    return spaces
