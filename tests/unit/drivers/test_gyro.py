"""The simulated LSM9DS1: temperature, its drift, and faults."""

import math
from dataclasses import dataclass
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.drivers.chips.lsm9ds1 import REG_OUT_X_G, Lsm9ds1
from companion.drivers.wires.bus import Transaction
from sitl.core.noise import stream
from sitl.sensors.i2c import DeviceBus
from sitl.sensors.lsm9ds1 import GyroNoise, Lsm9ds1Device, Warming, draw_warming

ADDRESS = 0x6B
REG_TEMP_LOW, REG_TEMP_HIGH = 0x15, 0x16
QUIET = GyroNoise(
    turn_on_bias_rad_s=0,
    flight_bias_rad_s=0,
    bias_walk_rad_s_sqrt_s=0,
    white_rad_s_sqrt_hz=0,
    scale=0,
    clock=0,
)
COLD = Warming(0.0)
FULL_SCALE_DEG_S = 32767 * 8.75e-3
COUNT_DEG_S = 8.75e-3


@dataclass
class Rig:
    """A gyro in a turn at constant rate."""

    bus: DeviceBus
    gyro: Lsm9ds1

    def rate_deg_s(self, time_s: float) -> float:
        """Mean rate over the quarter of a second before `time_s`, deg/s."""
        self.bus.set_time(time_s - 0.25)
        self.gyro.read(time_s - 0.25)
        self.bus.set_time(time_s)
        samples = self.gyro.read(time_s)
        return math.degrees(sum(s.yaw_rate_rad_s for s in samples) / len(samples))

    def temperature_counts(self, time_s: float) -> int:
        self.bus.set_time(time_s)
        answer = self.bus.transfer([Transaction(ADDRESS, bytes([REG_TEMP_LOW]), 2)])[0]
        return int.from_bytes(answer, "little", signed=True)


def rig(rate_deg_s: float = 0.0, warming: Warming = COLD, noise: GyroNoise = QUIET) -> Rig:
    device = Lsm9ds1Device(lambda time_s: math.radians(rate_deg_s), Random(1), warming, noise)
    bus = DeviceBus({ADDRESS: device})
    return Rig(bus, Lsm9ds1(bus, ADDRESS))


def test_the_chip_warms_with_its_time_constant() -> None:
    warming = Warming(0.0, room_deg_c=20, rise_deg_c=6, time_constant_s=180)
    assert warming.temperature_deg_c(0) == 20
    assert warming.temperature_deg_c(180) == pytest.approx(20 + 6 * (1 - 1 / math.e))
    assert warming.temperature_deg_c(3600) == pytest.approx(26)


@given(st.floats(-40, 85), st.floats(0, 600))
def test_the_temperature_registers_contain_the_chip_temperature(room: float, time_s: float) -> None:
    warming = Warming(0.0, room_deg_c=room)
    counts = rig(warming=warming).temperature_counts(time_s)
    assert 25 + counts / 16 == pytest.approx(warming.temperature_deg_c(time_s), abs=0.04)


def test_each_temperature_register_can_be_read_alone() -> None:
    bus = rig(warming=Warming(0.0, room_deg_c=5, rise_deg_c=0)).bus
    low, high = bus.transfer(
        [Transaction(ADDRESS, bytes([r]), 1) for r in (REG_TEMP_LOW, REG_TEMP_HIGH)]
    )
    assert int.from_bytes(low + high, "little", signed=True) == -20 * 16


def test_one_burst_reads_the_same_samples_as_single_reads() -> None:
    def samples_read(counts: list[int]) -> bytes:
        bus = rig(30.0, noise=GyroNoise()).bus
        bus.set_time(0.1)
        return b"".join(
            bus.transfer([Transaction(ADDRESS, bytes([REG_OUT_X_G]), n) for n in counts])
        )

    assert samples_read([60]) == samples_read([6] * 10)
    assert len(set(samples_read([60]))) > 4


def test_an_empty_fifo_reads_zero() -> None:
    bus = rig(30.0).bus
    assert bus.transfer([Transaction(ADDRESS, bytes([REG_OUT_X_G]), 12)]) == [bytes(12)]


def test_the_bias_changes_with_the_temperature() -> None:
    gyro = rig(warming=Warming(math.radians(0.05), rise_deg_c=4, time_constant_s=240))
    assert gyro.rate_deg_s(1.0) == pytest.approx(0.0, abs=COUNT_DEG_S)
    assert gyro.rate_deg_s(240.0) == pytest.approx(0.2 * (1 - 1 / math.e), abs=COUNT_DEG_S)
    assert gyro.rate_deg_s(2400.0) == pytest.approx(0.2, abs=COUNT_DEG_S)


def test_temperature_drifts_have_either_sign_and_are_within_the_prior() -> None:
    drifts = [math.degrees(draw_warming(stream(seed, "t")).bias_rad_s_deg_c) for seed in range(100)]
    assert all(0.03 <= abs(drift) <= 0.05 for drift in drifts)
    assert 30 < sum(drift > 0 for drift in drifts) < 70


def test_the_drift_by_warming_adds_to_the_noise() -> None:
    steady, warming = (rig(noise=GyroNoise(), warming=w) for w in (COLD, Warming(0.001)))
    for time_s in (1.0, 60.0, 600.0):
        added_deg_s = warming.rate_deg_s(time_s) - steady.rate_deg_s(time_s)
        expected_deg_s = math.degrees(Warming(0.001).bias_rad_s(time_s))
        assert added_deg_s == pytest.approx(expected_deg_s, abs=COUNT_DEG_S)


@given(st.floats(-2000, 2000))
def test_the_rate_saturates_at_full_scale_and_never_wraps(rate_deg_s: float) -> None:
    expected = max(-FULL_SCALE_DEG_S, min(FULL_SCALE_DEG_S, rate_deg_s))
    assert rig(rate_deg_s).rate_deg_s(1.0) == pytest.approx(expected, abs=2 * COUNT_DEG_S)
