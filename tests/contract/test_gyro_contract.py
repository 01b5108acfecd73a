"""Contract of all gyros: the companion's over each kind of wires, the autopilot's over MAVLink."""

import math
import random
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from companion.config.settings import SensorsConfig
from companion.drivers.autopilot_gyro import AutopilotGyro
from companion.drivers.gyro import open_gyro
from companion.drivers.wires.opening import open_bus
from companion.link.transports.transport import decode, make_codec
from sitl.autopilot.estimation.own_sensors import Imu
from sitl.core.noise import stream
from tests.contract.bench import STILL, TICK_S, Bench, Noisy, Switched, make_bench
from tests.contract.serving import Served

KINDS = ["lsm9ds1 in process", "lsm9ds1 served", "autopilot SCALED_IMU", "autopilot HIGHRES_IMU"]
IMU_S = 0.02
SMALL_AND_ODD = (0.0, -30.0, 30.0)
ODD = (*SMALL_AND_ODD, 1e30, math.nan, math.inf, -math.inf)
ANY_RAD_S = math.radians(2000)
"""Larger than any gyro's range."""


class Turntable:
    """A gyro on a turntable, read once per tick."""

    def __init__(self, bench: Bench, kind: str) -> None:
        self._bench = bench
        self._highres = kind.endswith("HIGHRES_IMU")
        name = "autopilot" if kind.startswith("autopilot") else "lsm9ds1"
        self._wires = Switched(bench.bus)
        self.gyro = open_gyro(self._wires, SensorsConfig(gyro=name))  # type: ignore[arg-type]
        self._imu = Imu(stream(1, kind))
        self._codec = make_codec(1, 1)
        self._sent_s = bench.time_s
        self.is_silent = False
        self.clock_s = 0.0
        """Lead of the autopilot's clock over the companion's, s."""
        self._garbage: random.Random | None = None

    def garble(self, seed: int | None) -> None:
        """Make every byte, or every number in a message, random; None restores them."""
        self._garbage = None if seed is None else random.Random(seed)
        self._wires.wires = self._bench.bus if seed is None else Noisy(seed)

    def tick(self) -> list[tuple[float, float]]:
        """Time and yaw rate of each new sample."""
        bench = self._bench
        bench.board.bus.is_broken = self.is_silent
        now_s = bench.passes(TICK_S)
        if isinstance(self.gyro, AutopilotGyro):
            self._send(now_s, self.gyro)
        return [(sample.time_s, sample.yaw_rate_rad_s) for sample in self.gyro.read(now_s)]

    def _send(self, now_s: float, gyro: AutopilotGyro) -> None:
        while self._sent_s + IMU_S <= now_s:
            self._sent_s += IMU_S
            message = self._message(self._sent_s + self.clock_s)
            if not self.is_silent:
                for received in decode(self._codec, message.pack(self._codec)):
                    gyro.receive(received, now_s)

    def _message(self, boot_s: float) -> Any:
        rate_rad_s = self._bench.truth.yaw_rate_rad_s
        if self._garbage:
            boot_s = self._garbage.uniform(0, 4e6)
            rate_rad_s = self._garbage.choice(ODD if self._highres else SMALL_AND_ODD)
        if self._highres:
            return self._imu.highres(round(1e6 * boot_s), rate_rad_s)
        return self._imu.scaled(round(1e3 * boot_s), rate_rad_s)

    def turned_deg(self, rate_deg_s: float, seconds: float) -> float:
        self._bench.truth = replace(STILL, yaw_rate_rad_s=math.radians(rate_deg_s))
        self.tick()
        total, last_s = 0.0, self._bench.time_s
        for _ in range(round(seconds / TICK_S)):
            for time_s, rate in self.tick():
                total += rate * (time_s - last_s)
                last_s = time_s
        return math.degrees(total)


@pytest.fixture(params=KINDS)
def turntable(request: pytest.FixtureRequest) -> Iterator[Turntable]:
    bench = make_bench("gp2y0a710k0f")
    if not request.param.endswith("served"):
        yield Turntable(bench, request.param)
        return
    with Served(bench.board.bus) as served:
        bench.bus = open_bus(f"sitl://127.0.0.1:{served.port}")
        yield Turntable(bench, request.param)
        bench.bus.close()


def test_clockwise_is_positive_and_in_radians(turntable: Turntable) -> None:
    still = turntable.turned_deg(0.0, 2.0)
    assert turntable.turned_deg(45.0, 2.0) - still == pytest.approx(90, rel=0.1)
    assert turntable.turned_deg(-45.0, 2.0) - still == pytest.approx(-90, rel=0.1)


def test_samples_are_returned_once_and_in_order(turntable: Turntable) -> None:
    times_s = [time_s for _ in range(40) for time_s, _ in turntable.tick()]
    assert len(times_s) > 80
    assert times_s == sorted(set(times_s))


def test_sample_times_are_within_the_last_0_1_s(turntable: Turntable) -> None:
    turntable.tick()
    turntable.tick()
    for _ in range(40):
        now_s = turntable._bench.time_s + TICK_S
        assert all(now_s - 0.1 <= time_s <= now_s + 1e-9 for time_s, _ in turntable.tick())


def test_a_silent_gyro_gives_no_samples_and_recovers(turntable: Turntable) -> None:
    for _ in range(3):
        turntable.tick()
    turntable.is_silent = True
    assert [turntable.tick() for _ in range(10)][-1] == []
    turntable.is_silent = False
    turntable.tick()
    turntable.tick()
    assert turntable.tick()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_bytes_give_no_impossible_rate_and_the_gyro_recovers(
    turntable: Turntable, seed: int
) -> None:
    still = turntable.turned_deg(0.0, 2.0)
    turntable.garble(seed)
    last_s = 0.0
    for _ in range(50):
        for time_s, rate_rad_s in turntable.tick():
            assert last_s < time_s <= turntable._bench.time_s + 1e-9
            assert abs(rate_rad_s) <= ANY_RAD_S
            last_s = time_s
    turntable.garble(None)
    turntable.turned_deg(0.0, 1.0)
    assert turntable.turned_deg(45.0, 2.0) - still == pytest.approx(90, rel=0.1)


@pytest.mark.parametrize("set_s", [-100.0, -2.0, 5.0])
def test_sample_times_follow_a_clock_step(turntable: Turntable, set_s: float) -> None:
    """The autopilot's clock steps, as at a restart; the companion's own gyros have no clock."""
    turntable.clock_s = 200.0
    turntable.turned_deg(0.0, 1.0)
    turntable.clock_s += set_s
    turntable.tick()
    for _ in range(20):
        samples = turntable.tick()
        assert samples
        now_s = turntable._bench.time_s
        assert all(now_s - 0.1 <= time_s <= now_s + 1e-9 for time_s, _ in samples)


@pytest.mark.parametrize("until_s", [0.1, 10.0], ids=["once", "once a second"])
def test_an_imu_message_that_a_ground_station_requested_does_not_silence_the_gyro(
    until_s: float,
) -> None:
    gyro, imu = AutopilotGyro(), Imu(stream(1, "gyro"))
    counts = []
    for number in range(1, 500):
        boot_s = number * IMU_S
        if boot_s <= until_s and number % 50 == 1:
            gyro.receive(imu.highres(round(1e6 * boot_s), 0.0), boot_s)
        gyro.receive(imu.scaled(round(1e3 * boot_s), 0.0), boot_s)
        counts.append(len(gyro.read(boot_s)))
    assert sum(counts) > 490
