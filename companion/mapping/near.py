"""What stands near the drone, as the beams met it a moment ago: what must not be hit.

The points are kept in a frame of their own that is only ever moved on, by odometry and by how the
heading turns. A step of the estimate, or a wall that was taken for another, moves the map but not
what is near.

A triangulating sensor folds back: what is nearer than half a metre reads as if it were a metre or
more away. From one reading nobody can tell, but what comes so near was met before, or by another
beam: a reading whose alias lies on a point that is known here is called too near.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from companion.frames import Vector2, frd_to_ned, ned_to_frd, wrap_rad
from companion.mapping.rays import BEARING_FRD_RAD
from companion.messages import Odometry, Pose, RangeModel, RangeReading, RangeScan, RangeState

KEPT_S = 40.0
"""After that the frame may have drifted by as much as the drone keeps off."""
WITHIN_M = 2.5
MOST_SIGMA_M = 0.06
SAME_M = 0.04
"""A point that is met again is one point, the new one."""
BESIDE_BEAM_M = 0.03
SEEN_THROUGH_M = 0.30
"""A beam that goes on so far beyond a point has shown that nothing is there any more."""
ALIAS_M = 0.15
"""So well must a folded reading fit a point that is known."""
ALIAS_ASIDE_M = 0.12
MOST_TURN_RAD = 0.3
"""A heading does not turn more in a tick; what does is a step of the estimate."""
UNMEASURED_M = 0.55
"""From the drone's centre: where something is put that is too near to be measured and is new."""
Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What the guard needs to know, body FRD, from the drone's centre."""

    points_frd_m: Points = field(default_factory=lambda: np.empty((0, 2)))
    """(n, 2), forward and right."""
    velocity_frd_m_s: Vector2 = (0.0, 0.0)


class Near:
    """Points around the drone, (n, 3): north, east in a frame of its own, and when it was met."""

    def __init__(self, sensor: RangeModel, mount_offset_m: float) -> None:
        self._sensor = sensor
        self._mount_offset_m = mount_offset_m
        self._points: Points = np.empty((0, 3))
        self._ne_m: Vector2 = (0.0, 0.0)
        self._yaw_rad = 0.0
        self._velocity_frd_m_s: Vector2 = (0.0, 0.0)
        self._pose: Pose | None = None
        self._odometry: Odometry | None = None

    @property
    def surroundings(self) -> Surroundings:
        return Surroundings(self._relative(), self._velocity_frd_m_s)

    def move(self, pose: Pose, odometry: Odometry | None) -> None:
        """The drone has turned as its pose says, and moved as odometry says."""
        if self._pose is not None and pose.reset_counter == self._pose.reset_counter:
            turned_rad = wrap_rad(pose.yaw_rad - self._pose.yaw_rad)
            if abs(turned_rad) < MOST_TURN_RAD:
                self._yaw_rad = wrap_rad(self._yaw_rad + turned_rad)
        self._pose = pose
        if odometry is None:
            return
        last, self._odometry = self._odometry, odometry
        self._velocity_frd_m_s = ned_to_frd(*odometry.velocity_ned_m_s[:2], odometry.yaw_rad)
        if last is None:
            return
        (x, y, _), (last_x, last_y, _) = odometry.position_ned_m, last.position_ned_m
        body_m = ned_to_frd(x - last_x, y - last_y, odometry.yaw_rad)
        north_m, east_m = frd_to_ned(*body_m, self._yaw_rad)
        self._ne_m = self._ne_m[0] + north_m, self._ne_m[1] + east_m

    def see(self, scan: RangeScan) -> RangeScan:
        """Take in a sweep; the same with readings that have folded back called too near."""
        points = self._points
        self._points = points[points[:, 2] > scan.time_s - KEPT_S]
        readings = dict(scan.readings)
        for beam, bearing_frd_rad in BEARING_FRD_RAD.items():
            reading = readings.get(beam)
            if reading is not None:
                readings[beam] = self._take_in(reading, bearing_frd_rad, scan.time_s)
        return replace(scan, readings=readings)

    def _take_in(self, reading: RangeReading, bearing_frd_rad: float, time_s: float) -> RangeReading:
        along_m, aside_m = self._off_beam(bearing_frd_rad)
        if reading.is_distance and self._has_folded(reading.distance_m, along_m, aside_m):
            return RangeReading(RangeState.TOO_NEAR)
        if reading.state is RangeState.TOO_NEAR:
            guess_m = 0.0 if math.isnan(reading.distance_m) else reading.distance_m
            end_m = max(guess_m + self._mount_offset_m, UNMEASURED_M)
            known = (aside_m < ALIAS_ASIDE_M) & (along_m > 0) & (along_m < end_m + ALIAS_M)
            if not known.any():
                self._put(end_m, bearing_frd_rad, time_s)
            return reading
        end_m = self._mount_offset_m + (
            reading.distance_m if reading.is_distance else self._sensor.max_m
        )
        if reading.is_distance or reading.state is RangeState.NOTHING:
            sigma_m = math.sqrt(reading.variance_m2) if reading.is_distance else 0.0
            through_m = end_m - SEEN_THROUGH_M - 2 * sigma_m
            gone = (aside_m < BESIDE_BEAM_M) & (along_m > 0) & (along_m < through_m)
            self._points = self._points[~gone]
            if reading.is_distance and end_m < WITHIN_M and sigma_m < MOST_SIGMA_M:
                self._put(end_m, bearing_frd_rad, time_s)
        return reading

    def _has_folded(self, distance_m: float, along_m: Points, aside_m: Points) -> bool:
        alias_m = self._sensor.alias_m(distance_m)
        if alias_m is None:
            return False
        off_m = np.abs(along_m - self._mount_offset_m - alias_m)
        return bool(((aside_m < ALIAS_ASIDE_M) & (off_m < ALIAS_M) & (along_m > 0)).any())

    def _off_beam(self, bearing_frd_rad: float) -> tuple[Points, Points]:
        """Of each point: how far along the beam, and how far beside it."""
        relative = self._relative()
        cos_b, sin_b = math.cos(bearing_frd_rad), math.sin(bearing_frd_rad)
        along_m = relative[:, 0] * cos_b + relative[:, 1] * sin_b
        return along_m, np.abs(relative[:, 1] * cos_b - relative[:, 0] * sin_b)

    def _put(self, end_m: float, bearing_frd_rad: float, time_s: float) -> None:
        bearing_rad = self._yaw_rad + bearing_frd_rad
        place = np.array(
            [
                self._ne_m[0] + end_m * math.cos(bearing_rad),
                self._ne_m[1] + end_m * math.sin(bearing_rad),
                time_s,
            ]
        )
        away_m = np.hypot(*(self._points[:, :2] - place[:2]).T)
        self._points = np.vstack([self._points[away_m > SAME_M], place])

    def _relative(self) -> Points:
        """(n, 2), forward and right of the drone's centre."""
        off = self._points[:, :2] - np.array(self._ne_m)
        cos_y, sin_y = math.cos(self._yaw_rad), math.sin(self._yaw_rad)
        rotation = np.array([[cos_y, -sin_y], [sin_y, cos_y]])
        relative: Points = off @ rotation
        return relative
