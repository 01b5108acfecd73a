"""What the drone sees at one moment, as every manoeuvre takes it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import field

from companion.core.known_walls import KnownWalls
from companion.core.messages import (
    BEARING_FRD_RAD,
    FIRST_LAG_S,
    Beam,
    Pose,
    RangeReading,
    RangeState,
)
from companion.core.values import value
from companion.safety.seen_free import Lane, all_passed


@value
class Observation:
    """Where it is, what its beams say, and what is mapped ahead of it."""

    pose: Pose
    ranges: Mapping[Beam, RangeReading]
    mount_offset_m: float
    standoff_m: float = 1.5
    """From the drone's centre to the wall that it scans, as planned."""
    bearings_frd_rad: Mapping[Beam, float] = field(default_factory=lambda: BEARING_FRD_RAD)
    """Where the level beams point."""
    wall_ahead: tuple[float, float] | None = None
    """Bearing of the perpendicular to the mapped wall that the nose points at, rad, and the
    distance along it, m."""
    walls: Callable[[], KnownWalls] = KnownWalls.none
    """All that are mapped; drawn up only when asked for."""

    lag_s: float = FIRST_LAG_S
    """How late it follows a velocity."""
    wander_m: float = 0.0
    """How far its autopilot's estimate wanders, one sigma."""
    lane: Callable[[float], Lane] = all_passed
    """What beams have gone through of the way to a bearing, FRD."""
    is_among_legs: bool = False
    """Something thin that stands alone was met lately."""

    def clear_m(self, beam: Beam) -> float:
        """Free distance from the drone's centre along a beam; 0 unless the beam says so."""
        reading = self.ranges.get(beam)
        if reading is None:
            return 0.0
        if not math.isnan(reading.distance_m):
            return reading.distance_m + self.mount_offset_m
        return math.inf if reading.state is RangeState.NOTHING else 0.0
