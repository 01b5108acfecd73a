"""One suite for every gyro: ours over each kind of wires, the autopilot's over MAVLink."""

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

from companion.config import SensorsConfig
from companion.drivers.autopilot import AutopilotGyro
from companion.drivers.bus import open_bus
from companion.drivers.gyro import open_gyro
from companion.link.transport import decode, make_codec
from sitl.autopilot.own_sensors import Imu
from sitl.noise import stream
from tests.contract.bench import STILL, TICK_S, Bench, make_bench
from tests.contract.serving import Served

KINDS = ["lsm9ds1 in process", "lsm9ds1 served", "autopilot SCALED_IMU", "autopilot HIGHRES_IMU"]
IMU_S = 0.02


class Turntable:
    """A gyro on a turntable, read once a tick."""

    def __init__(self, bench: Bench, kind: str) -> None:
        self._bench = bench
        self._highres = kind.endswith("HIGHRES_IMU")
        name = "autopilot" if kind.startswith("autopilot") else "lsm9ds1"
        self.gyro = open_gyro(bench.bus, SensorsConfig(gyro=name))
        self._imu = Imu(stream(1, kind))
        self._codec = make_codec(1, 1)
        self._told_s = bench.time_s
        self.is_silent = False

    def tick(self) -> list[tuple[float, float]]:
        """Time and yaw rate of each new sample."""
        bench = self._bench
        bench.board.bus.is_broken = self.is_silent
        now_s = bench.passes(TICK_S)
        if isinstance(self.gyro, AutopilotGyro):
            self._tell(now_s, self.gyro)
        return [(sample.time_s, sample.yaw_rate_rad_s) for sample in self.gyro.read(now_s)]

    def _tell(self, now_s: float, gyro: AutopilotGyro) -> None:
        while self._told_s + IMU_S <= now_s:
            self._told_s += IMU_S
            rate = self._bench.truth.yaw_rate_rad_s
            if self._highres:
                message = self._imu.highres(round(1e6 * self._told_s), rate)
            else:
                message = self._imu.scaled(round(1e3 * self._told_s), rate)
            if not self.is_silent:
                for heard in decode(self._codec, message.pack(self._codec)):
                    gyro.hear(heard, now_s)

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


def test_samples_are_told_once_and_in_order(turntable: Turntable) -> None:
    times_s = [time_s for _ in range(40) for time_s, _ in turntable.tick()]
    assert len(times_s) > 80
    assert times_s == sorted(set(times_s))


def test_no_sample_is_of_the_future_or_long_past(turntable: Turntable) -> None:
    turntable.tick()
    turntable.tick()
    for _ in range(40):
        now_s = turntable._bench.time_s + TICK_S
        assert all(now_s - 0.1 <= time_s <= now_s + 1e-9 for time_s, _ in turntable.tick())


def test_a_silent_gyro_has_no_samples_and_comes_back(turntable: Turntable) -> None:
    for _ in range(3):
        turntable.tick()
    turntable.is_silent = True
    assert [turntable.tick() for _ in range(10)][-1] == []
    turntable.is_silent = False
    turntable.tick()
    turntable.tick()
    assert turntable.tick()
