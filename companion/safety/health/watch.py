"""All that is watched, and the table of faults for which the drone holds or lands."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from companion.core.messages import (
    Beam,
    Fault,
    GyroSample,
    Odometry,
    RangeReading,
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
from companion.safety.health.unasked import UnaskedWatch

SILENT_S = 0.5
LINK_FAULT_LASTS_S = 3.0
SENSOR_FAULT_LASTS_S = 1.0
"""Blind in a room, the drone drifts; it lands sooner than for a silent link."""
HEADING_S = 0.15
"""Ranges are of no use when the heading is older by more: in a turn they would be 7° beside."""
STALE = RangeReading(RangeState.STALE)
NEEDED_BEAMS = (Beam.FRONT, Beam.LEFT, Beam.RIGHT)


class Health:
    """Of one drone."""

    def __init__(self) -> None:
        self._lateness = Lateness()
        self._steady = SteadyOdometry()
        self._gyro = GyroWatch()
        self._ranges = RangeWatch()
        self._mounting = MountingWatch()
        self._odometry_at_s = self._gyro_at_s = self._ranges_at_s = -math.inf
        """When each was last heard, in time that was listened to."""
        self._unasked = UnaskedWatch()
        self._yaw_rad = 0.0
        self._odometry_s = -math.inf
        self._place_ne_m = (0.0, 0.0)
        self._scan = RangeScan(0.0, {})

    def tick(self, now_s: float) -> None:
        """The loop comes round."""
        self._lateness.tick(now_s)

    def odometry(self, told: Odometry | None) -> Odometry | None:
        """Without its jumps."""
        steady = self._steady.take(told)
        if steady is not None:
            self._odometry_at_s = self._lateness.listened_s
            self._odometry_s = steady.time_s
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
        taken = self._gyro.take(now_s, samples, odometry, bias_rad_s)
        if self._gyro.came:
            self._gyro_at_s = self._lateness.listened_s
        return taken

    def ranges(self, scan: RangeScan, odometry: Odometry | None) -> RangeScan:
        """Only what can be believed, and only if it is known which way the drone looked."""
        self._scan = self._ranges.take(scan, odometry, self._gyro.turned_rad)
        if self._ranges.is_alive:
            self._ranges_at_s = self._lateness.listened_s
        if not self._is_placed(scan.time_s):
            return replace(scan, readings=dict.fromkeys(scan.readings, STALE))
        self._mounting.take(scan, self._place_ne_m, self._ranges.travel)
        return self._scan

    def _is_placed(self, time_s: float) -> bool:
        """The heading of that moment is known, and the place unless ticks are on time.

        A link that loses messages leaves out odometry now and then; but in a late tick the drone
        has flown on, and braked.
        """
        is_turned = abs(time_s - self._gyro.odometry_until_s) <= HEADING_S
        is_moved = abs(time_s - self._odometry_s) <= HEADING_S
        return is_turned and (is_moved or not self._lateness.is_late)

    @property
    def starved(self) -> str:
        """Why the computer has no time to fly; or nothing."""
        fault = self._lateness.fault
        return fault.text if fault is not None else ""

    def slowed(self, setpoint: Setpoint | None, clearance_m: float) -> Setpoint | None:
        """No faster than a computer that is late may fly."""
        return self._lateness.slowed(setpoint, clearance_m)

    def fault(self, vehicle: VehicleState) -> Fault | None:
        """The first of the table, by now."""
        return next(self._faults(vehicle), None)

    def _faults(self, vehicle: VehicleState) -> Iterator[Fault]:
        if vehicle.is_silent:
            yield Fault("the autopilot is silent", LINK_FAULT_LASTS_S)
        if starved := self._lateness.fault:
            yield starved
        if not self._lateness.is_late:  # else it is we who have not read in time
            yield from self._sensor_faults(vehicle)
        if self._mounting.misplaced:
            beams = ", ".join(self._mounting.misplaced)
            yield Fault(f"range sensors look elsewhere than they should: {beams}", 0.0)

    def _sensor_faults(self, vehicle: VehicleState) -> Iterator[Fault]:
        now_s = self._lateness.listened_s
        if now_s - self._odometry_at_s > SILENT_S > vehicle.silent_s:
            yield Fault("the autopilot tells no position", SENSOR_FAULT_LASTS_S)
        if self._unasked.has_flown_away:
            text = f"moves as nobody asked: {self._unasked.unasked_m_s:.1f} m/s"
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
