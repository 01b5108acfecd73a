"""A real drone flies only with a valid pass of a rehearsal; the simulator never needs one."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from companion.config.settings import Config
from companion.core.errors import LinkError, RehearsalError, SensorError
from companion.link.transports.transport import direct_pair
from companion.run import hardware
from companion.run.hardware import open_rig
from companion.run.preflight.bus_time import refuse_slow_bus
from companion.run.preflight.rehearsed import (
    RehearsalPass,
    passed_now,
    refuse_unrehearsed,
    store,
    valid_pass,
)
from sitl.core.radio import LinkErrors
from sitl.simulation.lockstep import LockstepClock
from sitl.simulation.simulation import Setup, Simulation
from sitl.world.loading import load_world

DAY_S = 86400.0
AUTOPILOT = "version 4.6.3, source 0, board 0"


def config_of(tmp_path: Path, **groups: Any) -> Config:
    groups.setdefault("preflight", {})["rehearsal_file"] = str(tmp_path / "pass.json")
    return Config.model_validate(groups)


def stored(config: Config, change: Callable[[RehearsalPass], RehearsalPass]) -> RehearsalPass:
    passed = change(passed_now(config, AUTOPILOT, ("arm: armed after 0.4 s",)))
    store(config.preflight.rehearsal_file, passed)
    return passed


def refusal(config: Config, now_unix_s: float) -> str:
    with pytest.raises(RehearsalError) as refused:
        valid_pass(config, now_unix_s)
    text = str(refused.value)
    assert "companion fly --rehearse" in text
    assert "preflight.rehearsal_file" in text
    return text


def test_a_drone_that_was_never_rehearsed_does_not_fly(tmp_path: Path) -> None:
    assert "passed no rehearsal" in refusal(config_of(tmp_path), 0.0)


def test_a_pass_is_valid_until_it_expires_and_also_before_a_clock_that_is_set_back(
    tmp_path: Path,
) -> None:
    config = config_of(tmp_path, preflight={"rehearsal_days": 2})
    passed = stored(config, lambda passed: passed)
    for days in (-400, 0, 1.9):
        assert valid_pass(config, passed.unix_s + days * DAY_S) == passed
    assert "rehearsal_days = 2" in refusal(config, passed.unix_s + 2.1 * DAY_S)


def test_another_program_needs_another_rehearsal(tmp_path: Path) -> None:
    config = config_of(tmp_path)
    stored(config, lambda passed: replace(passed, program="0.0.1"))
    assert "of companion 0.0.1" in refusal(config, 0.0)


def test_another_wiring_needs_another_rehearsal_and_another_mission_does_not(
    tmp_path: Path,
) -> None:
    stored(config_of(tmp_path), lambda passed: passed)
    assert valid_pass(config_of(tmp_path, mission={"speed_m_s": 0.3}), 0.0)
    changed = config_of(tmp_path, sensors={"profile": "vl53l1x"})
    assert "have changed since" in refusal(changed, 0.0)


def test_a_damaged_file_is_no_pass(tmp_path: Path) -> None:
    config = config_of(tmp_path)
    config.preflight.rehearsal_file.write_text("{")
    assert "not readable" in refusal(config, 0.0)


class Drone:
    """A simulated autopilot, for its identity."""

    def __init__(self, config: Config) -> None:
        setup = Setup(load_world("room_100"), "room_100", 1, config.sensors)
        sitl_end, self.transport = direct_pair(setup.system_id)
        self.simulation = Simulation(setup, [sitl_end])
        self.clock = LockstepClock(self.simulation, lambda: None)


def test_the_autopilot_of_the_rehearsal_may_fly_and_another_one_may_not(tmp_path: Path) -> None:
    config = config_of(tmp_path)
    drone = Drone(config)
    stored(config, lambda passed: passed)
    refuse_unrehearsed(config, drone.transport, drone.clock)
    stored(config, lambda passed: replace(passed, autopilot="version 4.5.7, source 0, board 7"))
    with pytest.raises(
        RehearsalError, match=r"version 4\.5\.7, .* and this one is version 4\.6\.3"
    ):
        refuse_unrehearsed(config, drone.transport, drone.clock)


def test_an_autopilot_that_does_not_answer_is_refused(tmp_path: Path) -> None:
    config = config_of(tmp_path)
    drone = Drone(config)
    drone.simulation.disturb_link(LinkErrors(loss=1.0))
    stored(config, lambda passed: passed)
    with pytest.raises(LinkError, match=r"link\.url = udpin:127\.0\.0\.1:14550: .*version"):
        refuse_unrehearsed(config, drone.transport, drone.clock)


class Opening:
    """`open_rig` on wires and links that stand for real ones."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, bus: str) -> None:
        self.config = Config.model_validate({"sensors": {"bus": bus}})
        drone = Drone(self.config)
        self.asked: list[str] = []
        self.needs_pilot: list[bool] = []
        made = hardware.rig_of

        def rig_of(*arguments: Any, needs_pilot: bool) -> Any:
            self.needs_pilot.append(needs_pilot)
            return made(*arguments, needs_pilot=needs_pilot)

        wires = drone.simulation.board.bus
        monkeypatch.setattr(type(wires), "close", lambda _: None, raising=False)
        monkeypatch.setattr(type(drone.transport), "close", lambda _: None, raising=False)
        monkeypatch.setattr(hardware, "open_transport", lambda *_: drone.transport)
        monkeypatch.setattr(hardware, "open_bus", lambda _: wires)
        monkeypatch.setattr(hardware, "open_clock", lambda *_: drone.clock)
        monkeypatch.setattr(hardware, "rig_of", rig_of)
        monkeypatch.setattr(hardware, "refuse_unrehearsed", lambda *_: self.asked.append("pass"))

    def open(self, *, skip_rehearsal: bool = False) -> None:
        with open_rig(self.config, None, pytest.fail, skip_rehearsal=skip_rehearsal):
            pass


def test_real_sensors_need_a_pass_and_a_pilot(monkeypatch: pytest.MonkeyPatch) -> None:
    real = Opening(monkeypatch, "/dev/i2c-1")
    real.open()
    assert (real.asked, real.needs_pilot) == (["pass"], [True])


def test_a_missing_sensor_is_told_before_a_missing_rehearsal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a laptop the remedy is the simulator."""
    laptop = Opening(monkeypatch, "/dev/i2c-1")
    laptop.config = Config.model_validate({"sensors": {"gyro_address": 0x6A}})
    with pytest.raises(SensorError):
        laptop.open()
    assert laptop.asked == []


def test_a_rehearsal_is_skipped_only_if_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    real = Opening(monkeypatch, "/dev/i2c-1")
    real.open(skip_rehearsal=True)
    assert (real.asked, real.needs_pilot) == ([], [True])


def test_the_simulator_needs_neither(monkeypatch: pytest.MonkeyPatch) -> None:
    simulated = Opening(monkeypatch, "sitl://127.0.0.1:5790")
    simulated.open()
    assert (simulated.asked, simulated.needs_pilot) == ([], [False])


class SlowClock:
    """A clock on which each read takes a given time; one in four is delayed by a pause."""

    def __init__(self, read_s: float) -> None:
        self._read_s = read_s
        self._now_s, self._reads = 0.0, 0

    def read(self, now_s: float) -> None:
        self._reads += 1
        self._now_s += self._read_s + (0.3 if self._reads % 4 == 0 else 0.0)

    def now_s(self) -> float:
        return self._now_s

    def wait_until(self, time_s: float) -> float:
        return time_s

    def close(self) -> None:
        pass


def test_a_bus_slower_than_the_tick_is_refused_and_a_pause_is_not() -> None:
    quick, slow = SlowClock(0.012), SlowClock(0.062)
    refuse_slow_bus(quick.read, quick, "/dev/i2c-1")
    with pytest.raises(SensorError, match=r"/dev/i2c-1: .* takes 62 ms of the 50 ms of a tick"):
        refuse_slow_bus(slow.read, slow, "/dev/i2c-1")
