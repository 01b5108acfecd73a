"""Contract of ADS1115 and LSM9DS1 on any bus: in process, served over TCP, or real."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from companion.config.settings import SensorsConfig
from companion.core.errors import SensorError
from companion.core.messages import Beam, RangeState
from companion.drivers.chips.lsm9ds1 import Lsm9ds1
from companion.drivers.ranges import RangeSensors
from companion.drivers.wires.bus import Bus, Transaction
from companion.drivers.wires.opening import open_bus
from tests.contract.bench import STILL, Bench, make_bench
from tests.contract.serving import Served

REAL_BUS = Path("/dev/i2c-1")


@pytest.fixture(params=["in process", "served"])
def transport(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def bench(transport: str) -> Iterator[Bench]:
    bench = make_bench("gp2y0a710k0f")
    if transport == "in process":
        yield bench
        return
    with Served(bench.board.bus) as served:
        bench.bus = open_bus(f"sitl://127.0.0.1:{served.port}")
        yield bench
        bench.bus.close()


def test_a_dead_chip_does_not_affect_the_other_chip(bench: Bench) -> None:
    sensors = RangeSensors(bench.bus, bench.config)
    bench.sweep(sensors)
    bench.board.bus.dead_addresses.add(0x49)
    scan = bench.sweep(sensors)
    assert scan.readings[Beam.UP].state is RangeState.STALE
    assert scan.readings[Beam.FRONT].is_distance


def test_a_missing_chip_stops_the_start_with_its_address(bench: Bench) -> None:
    bench.board.bus.dead_addresses.add(0x49)
    with pytest.raises(SensorError, match="0x49"):
        RangeSensors(bench.bus, bench.config)


def test_a_missing_gyro_stops_the_start_with_its_address(bench: Bench) -> None:
    bench.board.bus.dead_addresses.add(0x6B)
    with pytest.raises(SensorError, match="0x6b"):
        Lsm9ds1(bench.bus, 0x6B)


class Listening:
    """A bus that keeps what is written to registers."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self.written: list[bytes] = []

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        self.written += [t.data for t in transactions if len(t.data) > 1]
        return self._bus.transfer(transactions)

    def close(self) -> None: ...


def test_a_wrong_chip_at_the_gyro_address_is_refused_and_not_written_to(bench: Bench) -> None:
    bus = Listening(bench.bus)
    with pytest.raises(SensorError, match="no LSM9DS1"):
        Lsm9ds1(bus, 0x48)
    assert bus.written == []


def turned_deg(bench: Bench, gyro: Lsm9ds1, rate_deg_s: float, seconds: float) -> float:
    bench.truth = replace(STILL, yaw_rate_rad_s=math.radians(rate_deg_s))
    gyro.read(bench.time_s)
    total, last_s = 0.0, bench.time_s
    for _ in range(round(seconds / 0.05)):
        for sample in gyro.read(bench.passes(0.05)):
            total += sample.yaw_rate_rad_s * (sample.time_s - last_s)
            last_s = sample.time_s
    return math.degrees(total)


def test_clockwise_is_positive_and_in_radians(bench: Bench) -> None:
    gyro = Lsm9ds1(bench.bus, 0x6B)
    gyro.read(bench.time_s)
    still = turned_deg(bench, gyro, 0.0, 2.0)
    clockwise = turned_deg(bench, gyro, 45.0, 2.0)
    assert clockwise - still == pytest.approx(90, rel=0.1)


def test_no_gyro_sample_is_lost_between_reads(bench: Bench) -> None:
    gyro = Lsm9ds1(bench.bus, 0x6B)
    gyro.read(bench.passes(0.05))
    count = sum(len(gyro.read(bench.passes(0.05))) for _ in range(40))
    assert count == pytest.approx(2 * 119, rel=0.1)


def test_the_gyro_is_configured_again_after_a_bus_dropout(bench: Bench) -> None:
    gyro = Lsm9ds1(bench.bus, 0x6B)
    gyro.read(bench.passes(0.05))
    bench.board.bus.dead_addresses.add(0x6B)
    assert gyro.read(bench.passes(0.05)) == []
    bench.board.bus.dead_addresses.clear()
    gyro.read(bench.passes(0.05))
    assert gyro.read(bench.passes(0.05))


def test_the_gyro_is_configured_again_after_a_brown_out(bench: Bench) -> None:
    gyro = Lsm9ds1(bench.bus, 0x6B)
    for _ in range(3):
        gyro.read(bench.passes(0.05))
    bench.board.gyro.power_cycle()
    for _ in range(6):
        gyro.read(bench.passes(0.05))
    assert gyro.read(bench.passes(0.05))


def test_a_bus_without_a_server_is_refused_with_the_remedy() -> None:
    with pytest.raises(SensorError, match="sitl run"):
        open_bus("sitl://127.0.0.1:1")


@pytest.mark.skipif(not REAL_BUS.exists(), reason="no /dev/i2c-1 on this machine")
def test_the_real_sensors_answer() -> None:
    bus = open_bus(str(REAL_BUS))
    scan = RangeSensors(bus, SensorsConfig()).read(0.0)
    assert all(reading.is_alive for reading in scan.readings.values())
    assert Lsm9ds1(bus, 0x6B).read(0.0) == []
    bus.close()
