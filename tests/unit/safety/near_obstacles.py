"""A drone that moves and stores the obstacles near it, for tests of memory and velocity limit."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    RangeModel,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
    Setpoint,
)
from companion.safety.drift import NO_DRIFT, Drift
from companion.safety.obstacle_memory import ObstacleMemory, Surroundings
from companion.safety.swept_space import all_swept

CLEARANCE_M = 0.3
FORWARD = Setpoint(forward_m_s=1.0, yaw_rate_rad_s=0.3)
Place = tuple[float, float]


def near(sensor: RangeModel, offset_m: float) -> ObstacleMemory:
    """Obstacle memory of four such sensors, at `offset_m` from the drone's centre."""
    return ObstacleMemory(
        {beam: RangeUnit(sensor, at, offset_m) for beam, at in BEARING_FRD_RAD.items()}
    )


def scan(time_s: float, **readings: RangeReading) -> RangeScan:
    return RangeScan(time_s, {Beam(name): reading for name, reading in readings.items()})


def at(distance_m: float) -> RangeReading:
    return RangeReading(RangeState.DISTANCE, distance_m, 0.02**2)


class Drone:
    """A drone that moves along its nose, at first to the north, and measures."""

    def __init__(self, near: ObstacleMemory, drift: Drift = NO_DRIFT) -> None:
        self.near, self._drift = near, drift
        self._north_m = self._east_m = self._heading_rad = self._time_s = 0.0
        self.move(0.0)

    def move(self, forward_m: float, in_s: float = 0.05) -> None:
        self._time_s += in_s
        self._north_m += forward_m * math.cos(self._heading_rad)
        self._east_m += forward_m * math.sin(self._heading_rad)
        self.near.move_to((self._north_m, self._east_m), drift=self._drift)

    def turn_to(self, heading_rad: float) -> None:
        self._heading_rad = heading_rad
        self.near.turn_to(heading_rad)

    def see(self, **readings: RangeReading) -> RangeScan:
        return self.near.see(scan(self._time_s, **readings))

    def see_beside(self, walls_m: Mapping[Beam, float], **readings: RangeReading) -> RangeScan:
        """Measure beside walls of earlier flights."""
        return self.near.see(scan(self._time_s, **readings), walls_m)

    def sweep(self, **readings: RangeReading) -> None:
        """Sweep the beams over ±0.15 rad and return to the course."""
        for heading_rad in (*np.linspace(-0.15, 0.15, 61), 0.0):
            self.turn_to(float(heading_rad))
            self.see(**readings)

    def sweep_beside(self, from_m: float, to_m: float) -> None:
        """Sweep the front beam ten times beside a pole at 1.28 m that lies between two offsets."""
        for _ in range(10):
            for heading_rad in np.linspace(-0.15, 0.15, 61):
                if not from_m < 1.28 * heading_rad < to_m:
                    self.turn_to(float(heading_rad))
                    self.see(front=at(3.5))
        self.turn_to(0.0)

    @property
    def all_swept(self) -> Surroundings:
        """The surroundings, with all space swept."""
        return replace(self.near.surroundings(0.5), lane=all_swept)

    @property
    def points(self) -> list[Place]:
        """The points that are not vague."""
        around = self.near.surroundings(0.5)
        exact = around.points_frd_m[~around.is_vague]
        return [(float(f), float(r)) for f, r in exact]
