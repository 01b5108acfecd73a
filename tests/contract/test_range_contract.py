"""Contract of all range sensors, of any kind and on any wires."""

import math
import threading
from collections.abc import Iterator

import pytest

from companion.config.settings import SensorsConfig
from companion.core.errors import SensorError
from companion.core.messages import Beam, RangeReading, RangeScan, RangeState
from companion.drivers.models import model_of
from companion.drivers.ranges import RangeSensors
from companion.drivers.wires.opening import open_bus
from companion.drivers.wires.prompt import MAX_AT_ONCE_S
from sitl.sensors.line import on_virtual_time
from tests.contract.bench import FIVE, KINDS, TICK_S, Bench, Noisy, Switched, make_bench
from tests.contract.serving import Served

SETTLED_S = 0.6
"""After this time every sensor reports the current distance, s."""


@pytest.fixture(params=["in process", "served"])
def transport(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=KINDS)
def bench(request: pytest.FixtureRequest, transport: str) -> Iterator[Bench]:
    bench = make_bench(request.param)
    if transport == "in process":
        yield bench
        return
    with Served(bench.board.bus) as served:
        bench.bus = open_bus(f"sitl://127.0.0.1:{served.port}")
        yield bench
        bench.bus.close()


def sensors_of(bench: Bench) -> RangeSensors:
    sensors = RangeSensors(bench.bus, bench.config)
    settle(bench, sensors)
    return sensors


def settle(bench: Bench, sensors: RangeSensors) -> RangeScan:
    return [bench.sweep(sensors) for _ in range(round(SETTLED_S / 0.05))][-1]


def readings(bench: Bench, sensors: RangeSensors, beam: Beam, count: int) -> list[RangeReading]:
    return [bench.sweep(sensors).readings[beam] for _ in range(count)]


def test_every_beam_reads_its_own_distance_in_metres(bench: Bench) -> None:
    for i, beam in enumerate(FIVE):
        bench.distances_m[beam] = 1.3 + 0.3 * i
    sensors = sensors_of(bench)
    scans = [bench.sweep(sensors) for _ in range(40)]
    for beam in FIVE:
        measured = [scan.readings[beam] for scan in scans]
        assert all(reading.is_distance for reading in measured)
        mean_m = sum(reading.distance_m for reading in measured) / len(measured)
        assert mean_m == pytest.approx(bench.distances_m[beam], abs=0.05)


def test_a_scan_has_every_configured_beam(bench: Bench) -> None:
    assert set(bench.sweep(RangeSensors(bench.bus, bench.config)).readings) == set(FIVE)


def test_the_variance_matches_the_spread_of_the_readings(bench: Bench) -> None:
    bench.distances_m[Beam.FRONT] = 3.0
    measured = readings(bench, sensors_of(bench), Beam.FRONT, 200)
    values = [reading.distance_m for reading in measured]
    mean = sum(values) / len(values)
    spread = math.sqrt(sum((value - mean) ** 2 for value in values) / len(values))
    of_gain = (model_of(bench.config.beams[Beam.FRONT]).gain_sigma * 3.0) ** 2
    claimed = math.sqrt(sum(reading.variance_m2 - of_gain for reading in measured) / len(measured))
    assert 0.7 < spread / claimed < 1.3


def test_an_empty_range_gives_no_distance(bench: Bench) -> None:
    for beam in FIVE:
        bench.distances_m[beam] = None
    scan = settle(bench, RangeSensors(bench.bus, bench.config))
    assert {reading.state for reading in scan.readings.values()} == {RangeState.NOTHING}
    assert all(math.isnan(reading.distance_m) for reading in scan.readings.values())


def test_too_near_surfaces_are_not_reported_as_far(bench: Bench) -> None:
    for beam, sensor in bench.config.beams.items():
        bench.distances_m[beam] = 0.8 if model_of(sensor).min_m == 1.0 else 0.0
    sensors = sensors_of(bench)
    for beam in FIVE:
        measured = readings(bench, sensors, beam, 20)
        assert RangeState.TOO_NEAR in {reading.state for reading in measured}
        assert all(reading.distance_m < 0.3 for reading in measured if reading.is_distance)


def test_the_latency_of_readings_matches_the_model(bench: Bench) -> None:
    """A surface moves away at 2 m/s, so the error of a reading gives its age."""
    sensors = sensors_of(bench)
    bench.moving_away_m_s = 2.0
    lags_s: dict[Beam, list[float]] = {beam: [] for beam in FIVE}
    for beam in FIVE:
        bench.distances_m[beam] = 1.4
    for _ in range(60):
        bench.from_s = bench.time_s
        for _ in range(10):
            scan = bench.sweep(sensors)
            for beam, reading in scan.readings.items():
                true_m = bench.distance_m(beam, scan.time_s)
                if reading.is_distance and true_m is not None and scan.time_s > bench.from_s + 0.2:
                    lags_s[beam].append((true_m - reading.distance_m) / 2.0)
    for beam, sensor in bench.config.beams.items():
        model = model_of(sensor)
        mean_s = sum(lags_s[beam]) / len(lags_s[beam])
        gain_s = 3 * model.gain_sigma * 2.0 / 2.0
        assert mean_s == pytest.approx(model.mean_age_s, abs=0.012 + gain_s)


def test_only_an_unplugged_sensor_fails_and_it_recovers(bench: Bench) -> None:
    sensors = sensors_of(bench)
    bench.board.unplug("right")
    scan = settle(bench, sensors)
    assert scan.readings[Beam.RIGHT].state is RangeState.FAILED
    assert scan.readings[Beam.LEFT].is_distance
    bench.board.plug_in("right")
    assert settle(bench, sensors).readings[Beam.RIGHT].is_distance


def test_readings_on_a_silent_bus_become_stale_then_failed_and_recover(bench: Bench) -> None:
    sensors = sensors_of(bench)
    bench.board.bus.is_broken = True
    states = [reading.state for reading in readings(bench, sensors, Beam.FRONT, 12)]
    first_stale = states.index(RangeState.STALE)
    assert set(states[:first_stale]) <= {RangeState.DISTANCE}
    assert states[-1] is RangeState.FAILED
    assert states == sorted(states, key=[*RangeState].index)
    bench.board.bus.is_broken = False
    assert settle(bench, sensors).readings[Beam.FRONT].is_distance


@pytest.mark.parametrize("transport", ["in process"])
def test_a_hanging_bus_blocks_only_briefly_and_recovers(bench: Bench) -> None:
    """Skips the served bus, where time does not advance during that wait."""
    wires = on_virtual_time(bench.board.bus)
    sensors = RangeSensors(wires, bench.config)
    settle(bench, sensors)
    wired = [beam for beam, s in bench.config.beams.items() if s.kind != "autopilot"]
    bench.board.bus.hangs_s = 1.0
    for _ in range(30):
        before_s = bench.board.bus.time_s
        scan = bench.sweep(sensors)
        assert bench.board.bus.time_s - before_s <= TICK_S + MAX_AT_ONCE_S + 1e-9
    assert {scan.readings[beam].state for beam in wired} <= {RangeState.FAILED}
    bench.board.bus.hangs_s = 0.0
    for _ in range(20):  # the last transfer is still in progress
        bench.sweep(sensors)
    assert all(reading.is_distance for reading in settle(bench, sensors).readings.values())


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_bytes_give_no_impossible_distance_and_readings_recover(
    bench: Bench, seed: int
) -> None:
    wires = Switched(bench.bus)
    sensors = RangeSensors(wires, bench.config)  # type: ignore[arg-type]
    settle(bench, sensors)
    wires.wires = Noisy(seed)
    for _ in range(50):
        for beam, reading in bench.sweep(sensors).readings.items():
            model = model_of(bench.config.beams[beam])
            if reading.is_distance:
                assert model.min_m - 1e-9 <= reading.distance_m <= model.max_m + 1e-9
                assert reading.variance_m2 > 0
            else:
                guess = reading.state is RangeState.TOO_NEAR and reading.distance_m < model.min_m
                assert guess or math.isnan(reading.distance_m)
    wires.wires = bench.bus
    scan = settle(bench, sensors)
    for reading in scan.readings.values():
        assert reading.distance_m == pytest.approx(2.0, abs=0.25)


@pytest.mark.parametrize(
    ("sensor", "named"),
    [
        ({"kind": "sharp_ads1115", "address": 0x4B, "channel": 0}, ("0x4b", "ADDR")),
        ({"kind": "sharp_mcp3008", "device": "/dev/spidev1.1", "channel": 0}, ("/dev/spidev1.1",)),
        ({"kind": "vl53l1x", "address": 0x30}, ("0x30", "XSHUT")),
        ({"kind": "vl53l1x", "mux_address": 0x71, "mux_channel": 5}, ("0x71", "branch 5")),
        ({"kind": "vl53l1x", "address": 0x6B}, ("0x6b", "no VL53L1X")),
        ({"kind": "tfmini_s", "port": "/dev/ttyUSB7"}, ("/dev/ttyUSB7",)),
    ],
)
def test_a_missing_or_wrong_sensor_stops_the_start_and_is_named(
    transport: str, sensor: dict[str, object], named: tuple[str, ...]
) -> None:
    bench = make_bench("mixed")
    config = SensorsConfig.model_validate({"ranges": {"front": sensor}, "gyro": "autopilot"})
    with Served(bench.board.bus) as served:
        wires = bench.bus
        if transport == "served":
            wires = open_bus(f"sitl://127.0.0.1:{served.port}")
        with pytest.raises(SensorError) as refused:
            RangeSensors(wires, config)
        wires.close()
    assert all(word in str(refused.value) for word in named)
    assert "\n" not in str(refused.value)


def test_drivers_reconnect_to_a_served_bus() -> None:
    bench = make_bench("mixed")
    served = Served(bench.board.bus)
    with served:
        bus = open_bus(f"sitl://127.0.0.1:{served.port}")
        sensors = RangeSensors(bus, bench.config)
        assert settle(bench, sensors).readings[Beam.FRONT].is_distance
    bench.passes(1.0)
    assert not bench.sweep(sensors).readings[Beam.FRONT].is_alive
    with Served(bench.board.bus, served.port):
        deadline = threading.Event()
        for _ in range(30):
            if all(r.is_distance for r in bench.sweep(sensors).readings.values()):
                break
            deadline.wait(0.1)
        assert all(r.is_distance for r in bench.sweep(sensors).readings.values())
    bus.close()


def test_a_serial_sensor_with_a_wrong_baud_rate_fails() -> None:
    bench = make_bench("tfmini_s")
    ports = {b: {**s.model_dump(), "baud": 57600} for b, s in bench.config.beams.items()}
    config = SensorsConfig.model_validate({"ranges": ports})
    scan = settle(bench, RangeSensors(bench.bus, config))
    assert {reading.state for reading in scan.readings.values()} == {RangeState.FAILED}
