"""The team as one drone's flight uses it in each tick.

    hear     takes the teammates' packets, and removes readings that may be of teammates
    around   adds the teammates to the surroundings
    tell     makes the packets for the teammates

A drone that flies alone has no such object.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from companion.config.settings import Config
from companion.core.frames import frd_to_ned
from companion.core.messages import Beam, Pose, RangeScan
from companion.core.values import value
from companion.estimation.estimator import Estimator
from companion.estimation.smoothing.state import Unknowns
from companion.mapping.redrawn_grid import RedrawnGrid
from companion.pdps.flight.state import FlightState
from companion.safety.control_laws import CLIMB_LAG_S, MAX_CLIMB_M_S
from companion.safety.obstacle_memory import Surroundings
from companion.safety.separation import (
    OtherDrone,
    climb_limits,
    is_column_free,
    keep_off,
    lets_pass,
    without_others,
)
from companion.team.flight_state import needs_column, state_of, track_of
from companion.team.sharing import OwnMap
from companion.team.team import Team


@value
class Own:
    """The parts of this drone's flight that the team uses."""

    estimator: Estimator | None
    space: RedrawnGrid
    flight: FlightState


class OnBoardTeam:
    """The team of one drone in flight."""

    def __init__(
        self, config: Config, bearings_frd_rad: Mapping[Beam, float], instance: int
    ) -> None:
        """`bearings_frd_rad`: of the level beams, clockwise from the nose."""
        self.mates = Team(config.team, instance)
        self._mission = config.mission
        self._bearings_frd_rad = bearings_frd_rad
        self._others: tuple[OtherDrone, ...] = ()

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
        walls = partial(walls_of, own.estimator)
        self.mates.hear(now_s, packets, walls, own.space.grid)
        self._others = self.mates.others(now_s, waits=own.flight.waits)
        pose = own.estimator.pose(now_s) if own.estimator else Pose(now_s, 0.0, 0.0, 0.0, 0.0)
        return without_others(scan, pose, self._others, self._bearings_frd_rad)

    def around(self, around: Surroundings, pose: Pose, flight: FlightState) -> Surroundings:
        """The surroundings with the teammates."""
        others = self._others
        if not others:
            return around
        others_frd_m, keep_off_m = keep_off(others, pose, needs_column(flight, pose.height_m))
        level_m = flight.layers.height_m(self._mission)
        return replace(
            around,
            others_frd_m=others_frd_m,
            others_keep_off_m=keep_off_m,
            lets_pass=lets_pass(others, pose, level_m, passes=flight.passing is not None),
            is_column_free=is_column_free(others, pose),
            climb_limits_m_s=climb_limits(others, pose, MAX_CLIMB_M_S, CLIMB_LAG_S),
        )

    def tell(self, pose: Pose, own: Own, battery: float | None) -> tuple[bytes, ...]:
        """Packets for the teammates; none before the estimator has started."""
        if own.estimator is None:
            return ()
        traces = self._mission.kind == "room"
        own_map = OwnMap(
            own.space,
            own.estimator.record.poses,
            partial(walls_of, own.estimator),
            partial(track_of, own.flight) if traces else None,
        )
        state = partial(
            state_of,
            own.flight,
            pose,
            frd_to_ned(*own.estimator.velocity_frd_m_s, pose.yaw_rad),
            battery=battery,
            received=self.mates.received,
        )
        return self.mates.tell(pose.time_s, state, own_map)


def walls_of(estimator: Estimator | None) -> Unknowns:
    """All walls of this drone; none before its estimator has started."""
    x = Unknowns.at(np.zeros((1, 3)), 0.0)
    if estimator is not None:
        walls = estimator.walls()
        x.add_walls(walls.lines, walls.reach_m)
    return x
