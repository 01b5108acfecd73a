"""All that is watched, and the table of faults for which the drone holds or lands."""

import math
from collections.abc import Iterator, Sequence

from companion.health.gyro import GyroWatch
from companion.health.mounting import MountingWatch
from companion.health.odometry import SteadyOdometry
from companion.health.ranges import FAILED, RangeWatch
from companion.health.unasked import UnaskedWatch
from companion.messages import (
    Beam,
    Fault,
    GyroSample,
    Odometry,
    RangeScan,
    RangeState,
    Setpoint,
    VehicleState,
)

SILENT_S = 0.5
LINK_FAULT_LASTS_S = 3.0
SENSOR_FAULT_LASTS_S = 1.0
"""Blind in a room, the drone drifts; it lands sooner than for a silent link."""
NEEDED_BEAMS = (Beam.FRONT, Beam.LEFT, Beam.RIGHT)


class Health:
    """Of one drone."""

    def __init__(self) -> None:
        self._steady = SteadyOdometry()
        self._gyro = GyroWatch()
        self._ranges = RangeWatch()
        self._mounting = MountingWatch()
        self._unasked = UnaskedWatch()
        self._yaw_rad = 0.0
        self._odometry_s = -math.inf
        self._place_ne_m = (0.0, 0.0)
        self._scan = RangeScan(0.0, {})

    def odometry(self, now_s: float, told: Odometry | None) -> Odometry | None:
        """Without its jumps."""
        steady = self._steady.take(told)
        if steady is not None:
            self._odometry_s = now_s
            self._place_ne_m = steady.position_ned_m[:2]
            self._yaw_rad = steady.yaw_rad
            self._unasked.take(steady)
        return steady

    def asked(self, now_s: float, setpoint: Setpoint | None) -> None:
        """What the autopilot is asked to do from now on."""
        self._unasked.ask(now_s, setpoint, self._yaw_rad)

    def gyro(
        self,
        now_s: float,
        samples: Sequence[GyroSample],
        odometry: Odometry | None,
        bias_rad_s: float | None,
    ) -> Sequence[GyroSample]:
        """Without gaps."""
        return self._gyro.take(now_s, samples, odometry, bias_rad_s)

    def ranges(self, scan: RangeScan, odometry: Odometry | None) -> RangeScan:
        """Only what can be believed."""
        self._scan = self._ranges.take(scan, odometry, self._gyro.turned_rad)
        self._mounting.take(scan, self._place_ne_m, self._ranges.travel)
        return self._scan

    def fault(self, now_s: float, vehicle: VehicleState) -> Fault | None:
        """The first of the table, by now."""
        return next(self._faults(now_s, vehicle), None)

    def _faults(self, now_s: float, vehicle: VehicleState) -> Iterator[Fault]:
        if vehicle.is_silent:
            yield Fault("the autopilot is silent", LINK_FAULT_LASTS_S)
        if now_s - self._odometry_s > SILENT_S > vehicle.silent_s:
            yield Fault("the autopilot tells no position", SENSOR_FAULT_LASTS_S)
        if self._unasked.has_flown_away:
            text = f"moves as nobody asked: {self._unasked.unasked_m_s:.1f} m/s"
            yield Fault(text, SENSOR_FAULT_LASTS_S)
        if now_s - self._gyro.heard_s > SILENT_S:
            yield Fault("the gyro is silent", SENSOR_FAULT_LASTS_S)
        if self._gyro.complaint:
            yield Fault(self._gyro.complaint, SENSOR_FAULT_LASTS_S)
        if now_s - self._ranges.alive_s > SILENT_S:
            yield Fault("the range sensors are silent", SENSOR_FAULT_LASTS_S)
        readings = self._scan.readings
        failed = [b for b in NEEDED_BEAMS if readings.get(b, FAILED).state is RangeState.FAILED]
        if failed:
            yield Fault(f"range sensor failed: {', '.join(failed)}", SENSOR_FAULT_LASTS_S)
        if self._mounting.misplaced:
            beams = ", ".join(self._mounting.misplaced)
            yield Fault(f"range sensors look elsewhere than they should: {beams}", 0.0)
