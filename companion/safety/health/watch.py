"""Checks all inputs of the flight, and lists the faults for which the drone holds or lands."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from companion.core.messages import (
    STALE,
    Beam,
    Fault,
    GyroSample,
    Odometry,
    RangeScan,
    RangeState,
    Setpoint,
    VehicleState,
)
from companion.safety.health.gyro import GyroWatch
from companion.safety.health.lateness import Lateness
from companion.safety.health.mounting import MountingWatch
from companion.safety.health.odometry import SteadyOdometry
from companion.safety.health.ranges import FAILED, RangeWatch
from companion.safety.health.uncommanded_motion import UncommandedMotionWatch

SILENT_S = 0.5
"""Timeout of odometry, gyro and range sensors, s. Chosen."""
LINK_FAULT_LASTS_S = 3.0
"""Time for which the drone holds after the link fails, before it lands, s. Chosen."""
SENSOR_FAULT_LASTS_S = 1.0
"""Time for which the drone holds after a sensor fails, before it lands, s. Chosen: without sensors
the drone drifts, so it lands sooner than after a link failure."""
HEADING_S = 0.15
"""Maximum difference between the times of ranges and heading, s. Chosen: in a turn, older ranges
would be wrong by 7°."""
NEEDED_BEAMS = (Beam.FRONT, Beam.LEFT, Beam.RIGHT)
"""Beams without which the drone lands."""


class Health:
    """State of all checks of one drone."""

    def __init__(self) -> None:
        self._lateness = Lateness()
        self._steady = SteadyOdometry()
        self._gyro = GyroWatch()
        self._ranges = RangeWatch()
        self._mounting = MountingWatch()
        self._odometry_at_s = self._gyro_at_s = self._ranges_at_s = -math.inf
        """Time of the last input of each, s, on the clock `Lateness.listened_s`."""
        self._uncommanded = UncommandedMotionWatch()
        self._yaw_rad = 0.0
        self._odometry_s = -math.inf
        self._place_ne_m = (0.0, 0.0)
        self._scan = RangeScan(0.0, {})

    def tick(self, now_s: float) -> None:
        """Record the start of a tick at `now_s`."""
        self._lateness.tick(now_s)

    def odometry(self, report: Odometry | None) -> Odometry | None:
        """Return odometry without its jumps; None if it is missing or implausible."""
        steady = self._steady.take(report)
        if steady is not None:
            self._odometry_at_s = self._lateness.listened_s
            self._odometry_s = steady.time_s
            self._place_ne_m = steady.position_ned_m[:2]
            self._yaw_rad = steady.yaw_rad
            self._uncommanded.take(steady)
        return steady

    def asked(self, now_s: float, setpoint: Setpoint | None) -> None:
        """Record the setpoint that goes to the autopilot; None if there is none."""
        self._uncommanded.ask(now_s, setpoint, self._yaw_rad)

    def gyro(
        self,
        now_s: float,
        samples: Sequence[GyroSample],
        odometry: Odometry | None,
        bias_rad_s: float | None,
    ) -> Sequence[GyroSample]:
        """Return the gyro samples with gaps bridged."""
        taken = self._gyro.take(now_s, samples, odometry, bias_rad_s)
        if self._gyro.came:
            self._gyro_at_s = self._lateness.listened_s
        return taken

    def ranges(self, scan: RangeScan, odometry: Odometry | None) -> RangeScan:
        """Return the scan with invalid readings as FAILED, or all STALE if the pose is unknown."""
        self._scan = self._ranges.take(scan, odometry, self._gyro.turned_rad)
        if self._ranges.is_alive:
            self._ranges_at_s = self._lateness.listened_s
        if not self._is_placed(scan.time_s):
            return replace(scan, readings=dict.fromkeys(scan.readings, STALE))
        self._mounting.take(scan, self._place_ne_m, self._ranges.travel)
        return self._scan

    def _is_placed(self, time_s: float) -> bool:
        """Return True if the heading at `time_s` is known; in late ticks the position also counts.

        A lossy link drops odometry now and then, which is acceptable while ticks are on time. In a
        late tick the drone has flown further and braked.
        """
        is_turned = abs(time_s - self._gyro.odometry_until_s) <= HEADING_S
        is_moved = abs(time_s - self._odometry_s) <= HEADING_S
        return is_turned and (is_moved or not self._lateness.is_late)

    @property
    def starved(self) -> str:
        """Reason why the computer has too little time for the flight; empty if it has enough."""
        fault = self._lateness.fault
        return fault.text if fault is not None else ""

    def slowed(self, setpoint: Setpoint | None, clearance_m: float) -> Setpoint | None:
        """Limit the speed of the setpoint according to the delays of recent ticks."""
        return self._lateness.slowed(setpoint, clearance_m)

    def fault(self, vehicle: VehicleState) -> Fault | None:
        """Return the fault of the highest priority; None if there is none."""
        return next(self._faults(vehicle), None)

    def _faults(self, vehicle: VehicleState) -> Iterator[Fault]:
        if vehicle.is_silent:
            yield Fault("the autopilot is silent", LINK_FAULT_LASTS_S)
        if starved := self._lateness.fault:
            yield starved
        if not self._lateness.is_late:  # else the companion itself has read the sensors too late
            yield from self._sensor_faults(vehicle)
        if self._mounting.misplaced:
            beams = ", ".join(self._mounting.misplaced)
            yield Fault(f"range sensors look elsewhere than they should: {beams}", 0.0)

    def _sensor_faults(self, vehicle: VehicleState) -> Iterator[Fault]:
        now_s = self._lateness.listened_s
        if now_s - self._odometry_at_s > SILENT_S > vehicle.silent_s:
            yield Fault("the autopilot reports no position", SENSOR_FAULT_LASTS_S)
        if self._uncommanded.has_flown_away:
            text = f"uncommanded motion: {self._uncommanded.uncommanded_m_s:.1f} m/s"
            yield Fault(text, SENSOR_FAULT_LASTS_S)
        if now_s - self._gyro_at_s > SILENT_S:
            yield Fault("the gyro is silent", SENSOR_FAULT_LASTS_S)
        if self._gyro.complaint:
            yield Fault(self._gyro.complaint, SENSOR_FAULT_LASTS_S)
        if now_s - self._ranges_at_s > SILENT_S:
            yield Fault("the range sensors are silent", SENSOR_FAULT_LASTS_S)
        readings = self._scan.readings
        failed = [b for b in NEEDED_BEAMS if readings.get(b, FAILED).state is RangeState.FAILED]
        if failed:
            yield Fault(f"range sensor failed: {', '.join(failed)}", SENSOR_FAULT_LASTS_S)
