"""Late ticks raise a fault, and inputs that were read too late raise none."""

import math
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import (
    Beam,
    GyroSample,
    Odometry,
    RangeReading,
    RangeScan,
    RangeState,
    Setpoint,
    VehicleState,
)
from companion.safety.health.lateness import Lateness
from companion.safety.health.watch import Health

TICK_S = 0.05
CONNECTED = VehicleState(connected=True, silent_s=0.0, armed=True)
LEVEL = (Beam.FRONT, Beam.LEFT, Beam.RIGHT)


def after(steps_s: Sequence[float]) -> Lateness:
    lateness, now_s = Lateness(), 10.0
    lateness.tick(now_s)
    for step_s in steps_s:
        now_s += step_s
        lateness.tick(now_s)
    return lateness


def test_a_loop_with_ticks_in_time_has_no_fault() -> None:
    lateness = after([TICK_S] * 100)
    assert lateness.fault is None
    assert not lateness.is_late


def test_an_occasional_long_tick_is_no_fault() -> None:
    """Saving the map or solving the flight delays a tick now and then."""
    assert after(([TICK_S] * 60 + [0.3]) * 5).fault is None


@pytest.mark.parametrize("late_s", [0.2, 0.5, 0.8, 2.0])
def test_repeatedly_late_ticks_raise_a_fault(late_s: float) -> None:
    lateness = after([TICK_S] * 20 + [TICK_S + late_s] * 6)
    assert lateness.fault is not None
    assert lateness.fault.text == f"the computer is starved: ticks {late_s:.1f} s late"


def test_the_fault_ends_two_seconds_after_the_last_late_tick() -> None:
    assert after([1.0] * 5 + [TICK_S] * 30).fault is not None
    assert after([1.0] * 5 + [TICK_S] * 45).fault is None


@given(st.floats(0.16, 2.0), st.floats(-2, 2), st.floats(-2, 2), st.floats(0.1, 1.0))
def test_speed_is_limited_to_the_clearance_per_delay(
    late_s: float, forward_m_s: float, right_m_s: float, clearance_m: float
) -> None:
    requested = Setpoint(forward_m_s, right_m_s, 0.1, 0.5)
    slowed = after([TICK_S + late_s]).slowed(requested, clearance_m)
    assert slowed is not None
    speed_m_s = math.hypot(slowed.forward_m_s, slowed.right_m_s)
    assert speed_m_s * min(late_s, 0.5) <= clearance_m + 1e-9
    assert (slowed.down_m_s, slowed.yaw_rate_rad_s) == (0.1, 0.5)
    assert after([TICK_S] * 9).slowed(requested, clearance_m) is requested


class Drone:
    """A drone that turns at 45 deg/s; all its sensors are healthy whenever they are read."""

    RATE_RAD_S = math.radians(45)

    def __init__(self) -> None:
        self.health, self.now_s = Health(), 0.0
        self.faults: set[str] = set()
        self.placed = True
        self.turned_s = 0.0
        for _ in range(40):
            self.tick(TICK_S)

    def tick(self, step_s: float, gyro_late_s: float = 0.0, ranges_late_s: float = 0.0) -> None:
        """Run a tick that reads gyro and ranges later than the link by the given delays."""
        self.now_s += step_s
        now_s, gyro_s = self.now_s, self.now_s + gyro_late_s
        first_s = max(self.turned_s, gyro_s - 0.25)
        count = max(round((gyro_s - first_s) / 0.01), 1)
        spacing_s = (gyro_s - first_s) / count
        samples = [
            GyroSample(first_s + spacing_s * i, self.RATE_RAD_S) for i in range(1, count + 1)
        ]
        self.turned_s = gyro_s
        yaw_rad = math.remainder(self.RATE_RAD_S * now_s, math.tau)
        reported = Odometry(now_s, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), yaw_rad)
        scan_s = gyro_s + ranges_late_s
        state = RangeState.FAILED if step_s > 0.25 else RangeState.DISTANCE
        readings = {
            beam: RangeReading(state, 2.0 + 0.5 * math.sin((7 + place) * scan_s + place), 0.01)
            for place, beam in enumerate(LEVEL)
        }
        self.health.tick(scan_s)
        odometry = self.health.odometry(reported)
        self.health.gyro(scan_s, samples, odometry, 0.0)
        scan = self.health.ranges(RangeScan(scan_s, readings), odometry)
        self.now_s = scan_s
        self.placed = any(reading.is_alive for reading in scan.readings.values())
        if fault := self.health.fault(CONNECTED):
            self.faults.add(fault.text.split(":")[0])


@given(st.lists(st.floats(0.2, 2.0), min_size=1, max_size=8), st.integers(0, 10))
def test_late_readings_raise_no_sensor_fault(late_s: list[float], between: int) -> None:
    drone = Drone()
    for late in late_s:
        drone.tick(TICK_S + late)
        for _ in range(between):
            drone.tick(TICK_S)
    for _ in range(60):
        drone.tick(TICK_S)
    assert drone.faults <= {"the computer is starved"}
    assert drone.health.fault(CONNECTED) is None


@given(st.floats(0.2, 2.0), st.booleans())
def test_ranges_are_dropped_if_the_heading_is_of_another_time(late_s: float, before: bool) -> None:
    """The computer stops between link and gyro, or between gyro and ranges."""
    drone = Drone()
    drone.tick(TICK_S, late_s if before else 0.0, 0.0 if before else late_s)
    assert not drone.placed
    for _ in range(60):
        drone.tick(TICK_S)
    assert drone.placed
    assert drone.faults <= {"the computer is starved"}


def test_a_silent_autopilot_is_reported_once_ticks_are_in_time_again() -> None:
    drone = Drone()
    for _ in range(4):
        drone.tick(1.0)
    for _ in range(60):
        drone.health.tick(drone.now_s)
        drone.now_s += TICK_S
    fault = drone.health.fault(CONNECTED)
    assert fault is not None
    assert fault.text == "the autopilot reports no position"
