"""Defines what one tick of the control loop takes in and gives out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from companion.core.messages import Command, GyroSample, Pose, RangeScan, Setpoint, WallSegment
from companion.core.values import value
from companion.link.link import Telemetry
from companion.mapping.floor_plan import outline_closed
from companion.pdps.flight.order import Order
from companion.pdps.flight.state import FINAL_PHASES, FlightState


@value
class Inputs:
    """All inputs that arrived since the last tick."""

    telemetry: Telemetry
    gyro: Sequence[GyroSample]
    scan: RangeScan
    land_requested: bool = False
    order: Order | None = None
    """Order of a script; None to fly the whole mission."""
    team: tuple[bytes, ...] = ()
    """Packets of the teammates."""


@dataclass(frozen=True)
class Progress:
    """Progress of the flight, for display; the map is computed only when it is read."""

    time_s: float
    activity: str
    trouble: str
    map_walls: Callable[[], tuple[WallSegment, ...]]
    notice: str = ""
    """Message for the pilot."""

    @cached_property
    def _walls(self) -> tuple[WallSegment, ...]:
        return self.map_walls()

    @property
    def outline(self) -> float:
        """Share of all directions from the start in which the map has a wall, 0 to 1."""
        return outline_closed(self._walls, (0.0, 0.0))

    @property
    def walls_m(self) -> float:
        """Total length of the mapped walls, m."""
        return sum(wall.length_m for wall in self._walls)


@value
class Outputs:
    """Outputs of one tick."""

    setpoint: Setpoint | None
    command: Command | None
    pose: Pose | None
    """Estimated pose of the drone; None before the estimator has started."""
    progress: Progress
    flight: FlightState
    scan: RangeScan
    """Range readings after validation."""
    team: tuple[bytes, ...] = ()
    """Packets for the teammates."""

    @property
    def finished(self) -> bool:
        return self.flight.phase in FINAL_PHASES
