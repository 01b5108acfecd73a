"""The team as one drone's flight uses it in each tick.

    hear     takes the teammates' packets, and removes readings that may be of teammates
    around   adds the teammates to the surroundings
    tell     makes the packets for the teammates

A drone that flies alone has no such object.
"""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from companion.config.settings import Config
from companion.core.frames import Vector2, frd_to_ned
from companion.core.known_walls import KnownWalls, beside
from companion.core.messages import Beam, Pose, RangeScan
from companion.core.values import value
from companion.estimation.estimator import Estimator
from companion.estimation.smoothing.state import Unknowns
from companion.mapping.joined_grid import AllowedAbove
from companion.mapping.low_ceilings import Overhead
from companion.mapping.occupancy import Occupancy
from companion.mapping.redrawn_grid import RedrawnGrid
from companion.pdps.flight.state import FlightState
from companion.pdps.layers import layer_height_m
from companion.safety.control_laws import CLIMB_LAG_S, MAX_CLIMB_M_S
from companion.safety.obstacle_memory import Surroundings
from companion.safety.separation import (
    PASSING_M,
    OtherDrone,
    climb_limits,
    is_column_free,
    keep_off,
    keep_outs,
    lets_pass,
    without_others,
)
from companion.safety.velocity_guard import clear_of_all_m
from companion.team.flight_state import layer_of, needs_column, state_of, track_of
from companion.team.sharing import LOW_PERIOD_S, OwnMap
from companion.team.team import Team, TeamView

CLIMB_BESIDE_M = 0.5
"""A drone that climbs keeps its centre so far from things that hang low, m. Chosen: the body's
radius, and the errors of the place that it holds and of the map."""
LAYERS_APART_M = 0.7
"""Least height between two layers of a team, m. Chosen: beyond `MIN_VERTICAL_M`, by the errors of
two heights."""
NOT_BEGUN = Occupancy()
"""The own grid of a layer in which this drone has not been; nobody changes it."""


@value
class Own:
    """The parts of this drone's flight that the team uses."""

    estimator: Estimator | None
    spaces: Sequence[RedrawnGrid]
    """Of each layer, from the lowest."""
    flight: FlightState
    overhead: Overhead
    ceiling_m: float | None

    @property
    def layer(self) -> int:
        """The layer in which it flies."""
        return self.flight.layers.number


def with_layers_apart(config: Config) -> Config:
    """The configuration of a team with layers so far apart that drones pass over each other."""
    plan = config.mission
    if not config.team.name or plan.layer_spacing_m >= LAYERS_APART_M:
        return config
    apart = plan.model_copy(update={"layer_spacing_m": LAYERS_APART_M})
    return config.model_copy(update={"mission": apart})


class OnBoardTeam:
    """The team of one drone in flight."""

    def __init__(
        self, config: Config, bearings_frd_rad: Mapping[Beam, float], instance: int
    ) -> None:
        """`bearings_frd_rad`: of the level beams, clockwise from the nose."""
        self.mates = Team(config.team, math.radians(config.mission.turn_rate_deg_s), instance)
        self._mission = config.mission
        self._bearings_frd_rad = bearings_frd_rad
        self._others: tuple[OtherDrone, ...] = ()
        self._now_s = 0.0
        self._low: dict[float, tuple[float, tuple[Vector2, ...]]] = {}
        """Places where something hangs lower than a height, m, and when they were found, s."""
        self._allowed: defaultdict[int, AllowedAbove] = defaultdict(AllowedAbove)
        """Where each layer may be flown."""

    @classmethod
    def of(
        cls, config: Config, bearings_frd_rad: Mapping[Beam, float], instance: int
    ) -> "OnBoardTeam | None":
        """The team of the configuration; None if the drone flies alone."""
        return cls(config, bearings_frd_rad, instance) if config.team.name else None

    def hear(
        self, now_s: float, packets: tuple[bytes, ...], scan: RangeScan, own: Own
    ) -> RangeScan:
        """Take the teammates' packets.

        Returns the scan without readings that may be of a teammate instead of a wall.
        """
        self._now_s = now_s
        walls = partial(walls_of, own.estimator)
        space = own.spaces[own.layer].grid
        self.mates.hear(now_s, packets, walls, space, own.layer)
        layer = layer_of(own.flight)
        self._others = self.mates.others(now_s, waits=own.flight.waits, layer=layer)
        pose = own.estimator.pose(now_s) if own.estimator else Pose(now_s, 0.0, 0.0, 0.0, 0.0)
        return without_others(scan, pose, self._others, self._bearings_frd_rad)

    def around(self, around: Surroundings, pose: Pose, own: Own) -> Surroundings:
        """The surroundings with the teammates."""
        others, flight = self._others, own.flight
        if not others:
            return around
        others_frd_m, keep_off_m = keep_off(others, pose, needs_column(flight, pose.height_m))
        level_m = flight.layers.height_m(self._mission)
        is_above = flight.passing is not None
        passes = lets_pass(others, pose, level_m, passes=is_above)
        return replace(
            around,
            others_frd_m=others_frd_m,
            others_keep_off_m=keep_off_m,
            lets_pass=passes,
            may_climb=passes and not is_above and self._may_climb(pose, level_m, own),
            is_column_free=is_column_free(others, pose),
            climb_limits_m_s=climb_limits(others, pose, MAX_CLIMB_M_S, CLIMB_LAG_S),
        )

    def _may_climb(self, pose: Pose, level_m: float, own: Own) -> bool:
        """True if nothing is known near the drone that hangs too low for a climb by `PASSING_M`.

        Over an opening in a wall there may be a lintel, even if no up beam has met it.
        """
        if own.estimator and is_in_line_with_wall(walls_of(own.estimator), pose.ne_m):
            return False
        low_ne_m = self._lower_ne_m(own, level_m + PASSING_M + clear_of_all_m(self._mission))
        return all(math.dist(place, pose.ne_m) > CLIMB_BESIDE_M for place in low_ne_m)

    def view(self, pose: Pose, own: Own) -> TeamView:
        """What the missions know of the teammates."""
        now_s, flight = pose.time_s, own.flight
        view = self.mates.view(now_s, own.layer, goes_home=layer_of(flight) is None)
        in_column = needs_column(flight, pose.height_m)
        view["keep_outs"] = keep_outs(self._others, pose, in_column)
        if self._mission.kind == "layers":
            view["team_layers"] = self.mates.layers(now_s, partial(self.space, own))
        return view

    def known_walls(self, own: Own) -> KnownWalls:
        """All walls of this drone, as well as they are known to the team."""
        if own.estimator is None:
            return KnownWalls.none()
        return self.mates.with_measured(own.estimator.known_walls(), walls_of(own.estimator))

    def space(self, own: Own, layer: int | None = None) -> Occupancy:
        """The joined map of a layer, by default of the present one, and where it may be flown."""
        layer = own.layer if layer is None else layer
        own_grids = [*(space.grid for space in own.spaces[: layer + 1])]
        own_grids += [NOT_BEGUN] * (layer + 1 - len(own_grids))
        grids = [self.mates.joined(grid, number) for number, grid in enumerate(own_grids)]
        seen, low_ne_m = own.flight.layers.seen, partial(self._low_ne_m, own)
        return self._allowed[layer].of(grids, seen, low_ne_m)

    def _low_ne_m(self, own: Own, layer: int) -> tuple[Vector2, ...]:
        """Places where something hangs too low for a layer."""
        height_m = layer_height_m(layer, self._mission)
        return self._lower_ne_m(own, height_m + clear_of_all_m(self._mission))

    def _lower_ne_m(self, own: Own, top_m: float) -> tuple[Vector2, ...]:
        """Places where something hangs lower than a height, as known some seconds ago."""
        known_s, places = self._low.get(top_m, (-math.inf, ()))
        if self._now_s - known_s < LOW_PERIOD_S:
            return places
        places = own.overhead.lower_than(top_m, own.ceiling_m) + self.mates.low_ne_m(top_m)
        self._low[top_m] = self._now_s, places
        return places

    def tell(self, pose: Pose, own: Own, battery: float | None) -> tuple[bytes, ...]:
        """Packets for the teammates; none before the estimator has started."""
        if own.estimator is None:
            return ()
        kind = self._mission.kind
        own_map = OwnMap(
            own.spaces,
            own.layer,
            own.estimator.record.poses,
            own.estimator.known_walls,
            partial(track_of, own.flight) if kind == "room" else None,
            partial(own.overhead.heights, own.ceiling_m) if kind == "layers" else None,
        )
        state = partial(
            state_of,
            own.flight,
            pose,
            frd_to_ned(*own.estimator.velocity_frd_m_s, pose.yaw_rad),
            battery=battery,
            received=self.mates.received,
            links=self.mates.links(pose.time_s),
        )
        return self.mates.tell(pose.time_s, state, own_map)


def walls_of(estimator: Estimator | None) -> Unknowns:
    """All walls of this drone; none before its estimator has started."""
    x = Unknowns.at(np.zeros((1, 3)), 0.0)
    if estimator is not None:
        walls = estimator.walls()
        x.add_walls(walls.lines, walls.reach_m)
    return x


def is_in_line_with_wall(known: Unknowns, place_ne_m: Vector2) -> bool:
    """True near the line of a wall, along the wall or over an opening at its end."""
    place = np.array([place_ne_m])
    offsets_m = known.walls[:, 1]
    return bool(beside(place, known.normals, offsets_m, known.reach_m, CLIMB_BESIDE_M).any())
