"""One suite for the drivers, whatever bus they run on: in process, served over TCP, or real."""

import math
import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from companion.config import SensorsConfig
from companion.drivers.bus import Bus, open_bus
from companion.drivers.lsm9ds1 import Lsm9ds1
from companion.drivers.ranges import RangeSensors
from companion.errors import SensorError
from companion.frames import Vector3
from companion.messages import Beam, RangeScan, RangeState
from sitl.sensors.board import SensorBoard
from sitl.truth import TrueState
from tests.contract.serving import Served

REAL_BUS = Path("/dev/i2c-1")
STILL = TrueState(0.0, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)


@dataclass
class Bench:
    """Sensors on a table: distances and the yaw rate can be set, time passes when told."""

    bus: Bus
    board: SensorBoard
    config: SensorsConfig
    distances_m: dict[Beam, float | None]
    truth: TrueState
    time_s: float = 1.0

    def passes(self, seconds: float) -> float:
        self.time_s += seconds
        self.board.bus.set_time(self.time_s)
        return self.time_s

    def sweep(self, sensors: RangeSensors) -> RangeScan:
        return sensors.read(self.passes(0.05))


def make_bench(profile: str) -> Bench:
    config = SensorsConfig(profile=profile, mount_offset_m=0.0)
    bench: Bench

    def range_m(origin: Vector3, direction: Vector3, most_m: float) -> float | None:
        beam = min(bench.distances_m, key=lambda b: math.dist(direction, BEAM_DIRECTIONS[b]))
        distance = bench.distances_m[beam]
        return distance if distance is not None and distance <= most_m else None

    board = SensorBoard(
        1, config, lambda beam: range_m, lambda time_s: replace(bench.truth, time_s=time_s)
    )
    bench = Bench(board.bus, board, config, dict.fromkeys(BEAM_DIRECTIONS, 2.0), STILL)
    board.bus.set_time(bench.time_s)
    return bench


BEAM_DIRECTIONS: dict[Beam, Vector3] = {
    Beam.FRONT: (1.0, 0.0, 0.0),
    Beam.RIGHT: (0.0, 1.0, 0.0),
    Beam.LEFT: (0.0, -1.0, 0.0),
    Beam.UP: (0.0, 0.0, -1.0),
    Beam.DOWN: (0.0, 0.0, 1.0),
}


@pytest.fixture(params=["in process", "served"])
def transport(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=["gp2y0a710k0f", "paper"])
def bench(request: pytest.FixtureRequest, transport: str) -> Iterator[Bench]:
    bench = make_bench(request.param)
    if transport == "in process":
        yield bench
        return
    with Served(bench.board.bus) as served:
        bench.bus = open_bus(f"sitl://127.0.0.1:{served.port}")
        yield bench
        bench.bus.close()


def test_every_beam_reads_its_own_distance(bench: Bench) -> None:
    sensors = RangeSensors(bench.bus, bench.config)
    for i, beam in enumerate(bench.distances_m):
        bench.distances_m[beam] = 1.3 + 0.3 * i
    scans = [bench.sweep(sensors) for _ in range(40)]
    for beam, distance_m in bench.distances_m.items():
        readings = [scan.readings[beam] for scan in scans[1:]]
        assert all(reading.is_distance for reading in readings)
        mean_m = sum(reading.distance_m for reading in readings) / len(readings)
        assert mean_m == pytest.approx(distance_m, abs=0.05)


def test_the_spread_is_what_the_variance_says(bench: Bench) -> None:
    sensors = RangeSensors(bench.bus, bench.config)
    bench.distances_m[Beam.FRONT] = 3.0
    readings = [bench.sweep(sensors).readings[Beam.FRONT] for _ in range(200)]
    values = [reading.distance_m for reading in readings]
    mean = sum(values) / len(values)
    spread = math.sqrt(sum((value - mean) ** 2 for value in values) / len(values))
    claimed = math.sqrt(sum(reading.variance_m2 for reading in readings) / len(readings))
    assert 0.7 < spread / claimed < 1.3


def test_nothing_in_range_is_not_a_distance(bench: Bench) -> None:
    bench.distances_m[Beam.LEFT] = None
    sensors = RangeSensors(bench.bus, bench.config)
    bench.sweep(sensors)
    assert bench.sweep(sensors).readings[Beam.LEFT].state is RangeState.NOTHING


def test_an_unplugged_sensor_has_failed(bench: Bench) -> None:
    bench.board.unplug("right")
    scan = bench.sweep(RangeSensors(bench.bus, bench.config))
    assert scan.readings[Beam.RIGHT].state is RangeState.FAILED
    assert scan.readings[Beam.LEFT].is_distance


def test_a_silent_bus_is_stale_then_failed_then_well_again(bench: Bench) -> None:
    sensors = RangeSensors(bench.bus, bench.config)
    assert bench.sweep(sensors).readings[Beam.FRONT].is_distance
    bench.board.bus.is_broken = True
    assert bench.sweep(sensors).readings[Beam.FRONT].state is RangeState.STALE
    bench.passes(0.3)
    assert bench.sweep(sensors).readings[Beam.FRONT].state is RangeState.FAILED
    bench.board.bus.is_broken = False
    assert bench.sweep(sensors).readings[Beam.FRONT].is_distance


def test_one_dead_chip_leaves_the_other_alone(bench: Bench) -> None:
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


def test_a_wrong_chip_is_not_taken_for_a_gyro(bench: Bench) -> None:
    with pytest.raises(SensorError, match="no LSM9DS1"):
        Lsm9ds1(bench.bus, 0x48)


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


def test_a_gyro_that_comes_back_is_configured_again(bench: Bench) -> None:
    gyro = Lsm9ds1(bench.bus, 0x6B)
    gyro.read(bench.passes(0.05))
    bench.board.bus.dead_addresses.add(0x6B)
    assert gyro.read(bench.passes(0.05)) == []
    bench.board.bus.dead_addresses.clear()
    gyro.read(bench.passes(0.05))
    assert gyro.read(bench.passes(0.05))


def test_a_served_bus_that_closes_can_be_opened_again() -> None:
    bench = make_bench("paper")
    served = Served(bench.board.bus)
    with served:
        bus = open_bus(f"sitl://127.0.0.1:{served.port}")
        sensors = RangeSensors(bus, bench.config)
        assert bench.sweep(sensors).readings[Beam.FRONT].is_distance
    assert bench.sweep(sensors).readings[Beam.FRONT].state is RangeState.STALE
    with Served(bench.board.bus, served.port):
        deadline = threading.Event()
        for _ in range(30):
            if bench.sweep(sensors).readings[Beam.FRONT].is_distance:
                break
            deadline.wait(0.1)
        assert bench.sweep(sensors).readings[Beam.FRONT].is_distance
    bus.close()


def test_nobody_serving_is_told_with_the_remedy() -> None:
    with pytest.raises(SensorError, match="sitl run"):
        open_bus("sitl://127.0.0.1:1")


@pytest.mark.skipif(not REAL_BUS.exists(), reason="no /dev/i2c-1 on this machine")
def test_the_real_sensors_answer() -> None:
    bus = open_bus(str(REAL_BUS))
    scan = RangeSensors(bus, SensorsConfig()).read(0.0)
    assert all(reading.is_alive for reading in scan.readings.values())
    assert Lsm9ds1(bus, 0x6B).read(0.0) == []
    bus.close()
