"""Properties of the VL53L1X that other range sensors do not have."""

from random import Random

import pytest

from companion.core.messages import RangeState
from companion.drivers.chips.vl53l1x import MEANINGS, REG_MODE_START, TIMED, Vl53l1x
from companion.drivers.wires.bus import Transaction
from sitl.sensors.i2c import DeviceBus, Multiplexer
from sitl.sensors.time_of_flight import TOF_PHYSICS, TofUnit
from sitl.sensors.vl53l1x import Vl53l1xDevice

ADDRESS = 0x29


def device(distance_m: float | None) -> Vl53l1xDevice:
    return Vl53l1xDevice(TofUnit(TOF_PHYSICS["vl53l1x"], lambda time_s: distance_m, Random(1)))


def read_for(sensor: Vl53l1x, bus: DeviceBus, from_s: float, seconds: float) -> list[float]:
    distances = []
    for tick in range(round(seconds / 0.05)):
        time_s = from_s + 0.05 * tick
        bus.set_time(time_s)
        reading = sensor.read(time_s)
        if reading is not None and reading.is_distance:
            distances.append(reading.distance_m)
    return distances


def test_two_sensors_with_one_address_are_distinguished_by_their_branch() -> None:
    bus = DeviceBus({0x70: Multiplexer({0: {ADDRESS: device(1.0)}, 5: {ADDRESS: device(3.0)}})})
    near, far = (Vl53l1x(bus, ADDRESS, (0x70, branch)) for branch in (0, 5))
    for tick in range(40):
        bus.set_time(0.05 * tick)
        readings = near.read(0.05 * tick), far.read(0.05 * tick)
    assert readings[0] is not None
    assert readings[1] is not None
    assert readings[0].distance_m == pytest.approx(1.0, abs=0.05)
    assert readings[1].distance_m == pytest.approx(3.0, abs=0.05)


def test_the_sensor_is_configured_again_after_a_brown_out() -> None:
    chip = device(2.0)
    bus = DeviceBus({ADDRESS: chip})
    sensor = Vl53l1x(bus, ADDRESS, None)
    assert read_for(sensor, bus, 0.0, 1.0)
    chip.power_cycle(1.0)
    assert len(read_for(sensor, bus, 1.0, 1.0)) < 18
    assert len(read_for(sensor, bus, 2.0, 1.0)) == 20
    assert chip._registers[REG_MODE_START] == TIMED


@pytest.mark.parametrize("distance_m", [2.0, None])
def test_a_hung_sensor_that_repeats_its_last_result_gives_no_reading(
    distance_m: float | None,
) -> None:
    unit = TofUnit(TOF_PHYSICS["vl53l1x"], lambda time_s: distance_m, Random(1))
    bus = DeviceBus({ADDRESS: Vl53l1xDevice(unit)})
    sensor = Vl53l1x(bus, ADDRESS, None)
    for tick in range(60):
        time_s = 0.05 * tick
        bus.set_time(time_s)
        unit.is_stuck = time_s > 1.0
        readings = sensor.read(time_s)
        assert (readings is None) == (time_s > 1.2) or time_s < 0.2 or 1.0 < time_s <= 1.2


@pytest.mark.parametrize("status", range(32))
def test_only_a_valid_status_is_a_distance(status: int) -> None:
    reading = MEANINGS.get(status)
    assert reading is None or reading.state in (RangeState.NOTHING, RangeState.TOO_NEAR)


def test_a_target_too_noisy_to_measure_is_not_free_space() -> None:
    """Sigma failure: light returns, as in sunlight, from an unknown distance."""
    assert MEANINGS.get(6) is None


def test_behind_two_multiplexers_only_one_branch_is_connected() -> None:
    """All connected chips with one address answer together."""
    muxes = {
        0x70: Multiplexer({0: {ADDRESS: device(1.0)}, 1: {ADDRESS: device(2.0)}}),
        0x71: Multiplexer({0: {ADDRESS: device(3.0)}}),
    }
    bus = DeviceBus(muxes)
    for address in muxes:  # all branches connected, as an earlier program may leave them
        bus.transfer([Transaction(address, b"\xff")])
    places = {1.0: (0x70, 0), 2.0: (0x70, 1), 3.0: (0x71, 0)}
    sensors = {
        true_m: Vl53l1x(bus, ADDRESS, mux, [other for other in muxes if other != mux[0]])
        for true_m, mux in places.items()
    }
    for tick in range(40):
        bus.set_time(0.05 * tick)
        readings = {true_m: sensor.read(0.05 * tick) for true_m, sensor in sensors.items()}
    for true_m, reading in readings.items():
        assert reading is not None
        assert reading.distance_m == pytest.approx(true_m, abs=0.05)
