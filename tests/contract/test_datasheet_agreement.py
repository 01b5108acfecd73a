"""Drivers and simulated chips, which state the datasheets' constants separately, agree.

The chips here have no noise, so each driver must return the true value to the chip's resolution.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import RangeReading, RangeState
from companion.drivers.chips import ads1115
from companion.drivers.chips.lsm9ds1 import Lsm9ds1
from companion.drivers.chips.mcp3008 import Mcp3008
from companion.drivers.chips.sharp import PROFILES, SharpProfile
from companion.drivers.chips.tfmini import Tfmini
from companion.drivers.chips.time_of_flight import SERIAL_KINDS
from companion.drivers.chips.vl53l1x import Vl53l1x
from companion.drivers.wires.bus import Transaction
from sitl.sensors.ads1115 import Ads1115Device
from sitl.sensors.i2c import DeviceBus
from sitl.sensors.lsm9ds1 import GyroNoise, Lsm9ds1Device, Warming
from sitl.sensors.mcp3008 import Mcp3008Device
from sitl.sensors.sharp import PHYSICS
from sitl.sensors.tfmini import TfminiDevice
from sitl.sensors.time_of_flight import TOF_PHYSICS, TofUnit
from sitl.sensors.vl53l1x import OSCILLATOR, Vl53l1xDevice

ADC, GYRO, TOF = 0x48, 0x6B, 0x29
SPI, PORT = "/dev/spidev0.0", "/dev/ttyAMA1"
TOF_MODELS = {"vl53l1x": Vl53l1x.model, **SERIAL_KINDS}
EXACT = GyroNoise(
    turn_on_bias_rad_s=0.0,
    flight_bias_rad_s=0.0,
    bias_walk_rad_s_sqrt_s=0.0,
    white_rad_s_sqrt_hz=0.0,
    scale=0.0,
    clock=0.0,
)


@given(st.lists(st.floats(-4.09, 4.09), min_size=4, max_size=4))
def test_ads1115_driver_reads_each_input_to_half_a_count(volts: list[float]) -> None:
    bus = DeviceBus({ADC: Ads1115Device(lambda channel, time_s: volts[channel])})
    read_v = ads1115.ConversionSweep([(ADC, channel) for channel in range(4)]).volts(bus)
    for channel in range(4):
        assert read_v[ADC, channel] == pytest.approx(volts[channel], abs=125e-6 / 2 + 1e-12)


def test_ads1115_driver_starts_one_conversion_at_860_samples_per_second() -> None:
    """Single-ended, ±4.096 V, single-shot, comparator off: the words of the datasheet's fields."""
    words = [ads1115.config_word(channel) for channel in range(4)]
    assert words == [0xC3E3, 0xD3E3, 0xE3E3, 0xF3E3]


@given(st.lists(st.floats(0, 3.29), min_size=8, max_size=8))
def test_mcp3008_driver_reads_each_input_to_one_count(volts: list[float]) -> None:
    bus = DeviceBus({}, {SPI: Mcp3008Device(lambda channel, time_s: volts[channel], 3.3)})
    read_v = Mcp3008(bus, SPI, 3.3).volts(range(8))
    for channel in range(8):
        assert -1e-12 <= volts[channel] - read_v[channel] <= 3.3 / 1024 + 1e-12


def gyro_at(rate_deg_s: float) -> tuple[DeviceBus, Lsm9ds1]:
    device = Lsm9ds1Device(lambda time_s: math.radians(rate_deg_s), Random(1), Warming(0.0), EXACT)
    bus = DeviceBus({GYRO: device})
    return bus, Lsm9ds1(bus, GYRO)


@given(st.floats(-286, 286))
def test_lsm9ds1_driver_reads_the_rate_to_half_a_count(rate_deg_s: float) -> None:
    bus, gyro = gyro_at(rate_deg_s)
    gyro.read(0.0)
    bus.set_time(0.2)
    samples = gyro.read(0.2)
    assert len(samples) in (22, 23, 24)
    for sample in samples:
        read_deg_s = math.degrees(sample.yaw_rate_rad_s)
        assert read_deg_s == pytest.approx(rate_deg_s, abs=8.75e-3 / 2 + 1e-9)


def test_lsm9ds1_driver_dates_the_samples_of_a_full_fifo() -> None:
    """After a pause the FIFO holds the 32 latest samples at 119 Hz, and older ones are lost."""
    bus, gyro = gyro_at(10.0)
    gyro.read(0.0)
    bus.set_time(1.0)
    times_s = [sample.time_s for sample in gyro.read(1.0)]
    assert len(times_s) == 32
    assert times_s[0] == pytest.approx(1.0 - 31 / 119, abs=1 / 119)
    assert times_s[-1] == pytest.approx(1.0, abs=1 / 119)


@pytest.mark.parametrize(
    ("register", "value"),
    [(0x20, 0x00), (0x22, 0x44)],
    ids=["accelerometer off", "block update, address increments"],
)
def test_lsm9ds1_driver_sets_the_control_registers(register: int, value: int) -> None:
    """Registers that the simulated chip stores without an effect (DocID025715, section 7)."""
    bus, _ = gyro_at(0.0)
    assert bus.transfer([Transaction(GYRO, bytes([register]), 1)]) == [bytes([value])]


@pytest.mark.parametrize("name", PROFILES)
def test_sharp_driver_inverts_the_curve_of_the_simulated_sensor(name: str) -> None:
    """Every centimetre or less of the range, so that every piece of the curve is compared."""
    profile = PROFILES[name]
    for step in range(1, 500):
        distance_m = profile.min_m + step / 500 * (profile.max_m - profile.min_m)
        reading = profile.reading(PHYSICS[name].output_v(distance_m))
        assert reading.distance_m == pytest.approx(distance_m, abs=1e-6)


@pytest.mark.parametrize("name", PROFILES)
def test_sharp_driver_and_simulated_sensor_have_the_same_period_and_noise(name: str) -> None:
    profile, physics = PROFILES[name], PHYSICS[name]
    assert (profile.mean_age_s, profile.noise_v, profile.gain_sigma) == (
        physics.period_s / 2,
        physics.output_noise_v,
        physics.gain_sigma,
    )
    if physics.distance_noise_m:
        assert profile.sigma_m(2.0) == physics.distance_noise_m


@pytest.mark.parametrize("name", PROFILES)
def test_sharp_driver_reads_nothing_from_the_output_without_a_return(name: str) -> None:
    profile, physics = PROFILES[name], PHYSICS[name]
    without_v = physics.output_v(None)
    assert profile.volts(None) == without_v
    for sigmas in (-5, 0, 5):
        volts = without_v + sigmas * physics.output_noise_v
        assert profile.reading(volts).state is RangeState.NOTHING


@given(st.floats(0.0, 0.49))
def test_sharp_driver_knows_the_distance_of_an_alias(distance_m: float) -> None:
    profile, physics = PROFILES["gp2y0a710k0f"], PHYSICS["gp2y0a710k0f"]
    assert isinstance(profile, SharpProfile)
    reading = profile.reading(physics.output_v(distance_m))
    if reading.is_distance:
        assert profile.alias_m(reading.distance_m) == pytest.approx(distance_m, abs=1e-6)


@given(st.floats(0.501, 0.999))
def test_sharp_driver_estimates_a_distance_that_is_too_near(distance_m: float) -> None:
    profile, physics = PROFILES["gp2y0a710k0f"], PHYSICS["gp2y0a710k0f"]
    reading = profile.reading(physics.output_v(distance_m))
    assert reading.state is RangeState.TOO_NEAR
    assert reading.distance_m == pytest.approx(distance_m, abs=1e-6)


def tof_reading(name: str, distance_m: float | None) -> RangeReading:
    """The driver's reading of a sensor without errors."""
    physics = replace(
        TOF_PHYSICS[name], noise_m=0.0, noise_share=0.0, gain_sigma=0.0, period_spread=0.0
    )
    unit = TofUnit(physics, lambda time_s: distance_m, Random(1))
    reading: RangeReading | None = None
    if name == "vl53l1x":
        bus = DeviceBus({TOF: Vl53l1xDevice(unit)})
        sensor: Vl53l1x | Tfmini = Vl53l1x(bus, TOF, None)
    else:
        bus = DeviceBus({}, ports={PORT: TfminiDevice(unit)})
        sensor = Tfmini(bus, PORT, 115200, SERIAL_KINDS[name])
    for tick in range(4):
        bus.set_time(0.05 * tick)
        reading = sensor.read(0.05 * tick) or reading
    assert reading is not None
    return reading


@pytest.mark.parametrize("name", TOF_PHYSICS)
@given(share=st.floats(0.01, 0.99))
def test_time_of_flight_driver_reads_the_distance_to_its_resolution(
    name: str, share: float
) -> None:
    physics = TOF_PHYSICS[name]
    distance_m = physics.min_m + share * (physics.max_m - physics.min_m)
    reading = tof_reading(name, distance_m)
    assert reading.distance_m == pytest.approx(distance_m, abs=physics.resolution_m / 2 + 1e-9)


@pytest.mark.parametrize("name", TOF_PHYSICS)
def test_time_of_flight_driver_has_the_specified_range(name: str) -> None:
    physics = TOF_PHYSICS[name]
    step_m = 2 * physics.resolution_m
    assert tof_reading(name, physics.min_m - step_m).state is RangeState.TOO_NEAR
    assert tof_reading(name, physics.min_m + step_m).is_distance
    assert tof_reading(name, physics.max_m - step_m).is_distance
    assert tof_reading(name, physics.max_m + step_m).state is RangeState.NOTHING
    assert tof_reading(name, None).state is RangeState.NOTHING


@pytest.mark.parametrize("name", TOF_PHYSICS)
@given(share=st.floats(0, 1))
def test_time_of_flight_model_has_the_noise_of_the_simulated_sensor(
    name: str, share: float
) -> None:
    model, physics = TOF_MODELS[name], TOF_PHYSICS[name]
    distance_m = physics.min_m + share * (physics.max_m - physics.min_m)
    noise_m = max(physics.noise_m, physics.noise_share * distance_m)
    assert model.gain_sigma == physics.gain_sigma
    assert model.period_s == physics.period_s
    assert model.sigma_m(distance_m) == pytest.approx(
        math.hypot(noise_m, physics.gain_sigma * distance_m)
    )


def test_vl53l1x_driver_sets_the_interval_of_the_measurements() -> None:
    """ST's driver multiplies ticks per millisecond by the interval, ms, and by 1.075."""
    unit = TofUnit(TOF_PHYSICS["vl53l1x"], lambda time_s: 1.0, Random(1))
    bus = DeviceBus({TOF: Vl53l1xDevice(unit)})
    Vl53l1x(bus, TOF, None).read(0.0)
    (period,) = bus.transfer([Transaction(TOF, bytes([0x00, 0x6C]), 4)])
    interval_s = TOF_PHYSICS["vl53l1x"].period_s
    assert int.from_bytes(period, "big") == round(OSCILLATOR * 1e3 * interval_s * 1.075)


@pytest.mark.parametrize(
    ("register", "value"),
    [
        (0x0030, b"\x01"),  # interrupt active high
        (0x0046, b"\x20"),  # interrupt at each new measurement
        (0x004B, b"\x0a"),  # timeout of the phase calibration
        (0x005E, b"\x00\x60\x0f"),  # phase A: timeout for 33 ms, pulse period
        (0x0061, b"\x00\x6e\x0d"),  # phase B: timeout for 33 ms, pulse period
        (0x0069, b"\xb8"),  # largest valid phase
        (0x0078, b"\x0f\x0d\x0e\x0e"),  # windows and initial phases of A and B
    ],
)
def test_vl53l1x_driver_sets_long_distance_mode_and_33_ms(register: int, value: bytes) -> None:
    """Registers that the simulated chip stores without an effect; values of ST's driver."""
    unit = TofUnit(TOF_PHYSICS["vl53l1x"], lambda time_s: 1.0, Random(1))
    bus = DeviceBus({TOF: Vl53l1xDevice(unit)})
    Vl53l1x(bus, TOF, None).read(0.0)
    read = Transaction(TOF, register.to_bytes(2, "big"), len(value))
    assert bus.transfer([read]) == [value]


def test_vl53l1x_driver_reads_a_result_when_ready_and_clears_the_interrupt() -> None:
    class Recorded(DeviceBus):
        def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
            registers.extend(transaction.data[:2] for transaction in transactions)
            return super().transfer(transactions)

    registers: list[bytes] = []
    unit = TofUnit(TOF_PHYSICS["vl53l1x"], lambda time_s: 1.0, Random(1))
    bus = Recorded({TOF: Vl53l1xDevice(unit)})
    sensor = Vl53l1x(bus, TOF, None)
    sensor.read(0.0)
    assert b"\x00\x89" not in registers
    bus.set_time(0.1)
    assert sensor.read(0.1)
    assert b"\x00\x89" in registers
    (ready,) = bus.transfer([Transaction(TOF, b"\x00\x31", 1)])
    assert not ready[0] & 0x01
