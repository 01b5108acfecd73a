"""The rehearsal passes on a sound drone, and names each fault that is injected."""

from collections.abc import Callable, Mapping

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.bringup import rehearsal
from companion.bringup.findings import CheckResult, Finding
from companion.bringup.rehearsal import Rehearsal, Stage
from companion.bringup.self_test import Examination
from companion.config.settings import Config
from companion.link.transports.transport import direct_pair
from sitl.autopilot.firmware import Throttle
from sitl.core.radio import LinkErrors
from sitl.simulation.simulation import Setup, Simulation
from sitl.testing import Action, battery, other_rates, pilot_arms, refuse_arming, unplug
from sitl.world.loading import load_world
from tests.deployed import loaded

STABILIZE, ALT_HOLD, GUIDED, LOITER = 0, 2, 4, 5
POSCTL, ALTCTL = 3 << 16, 2 << 16
SWITCH = {"ardupilot": (ALT_HOLD, LOITER), "px4": (ALTCTL, POSCTL)}
"""Modes of both positions of the pilot's switch: where it is, and where it takes over."""
TICK_S = 0.05
WORLD = load_world("room_100")
Act = Callable[["Rehearsed"], None]


class Rehearsed:
    """A rehearsal with a simulated drone, which has the parameters of deploy/, and its pilot.

    The pilot follows the prompts. `acts` happen when their stage begins.
    """

    def __init__(
        self,
        autopilot: str = "ardupilot",
        acts: Mapping[Stage, Act] | None = None,
        *,
        transmitter: bool = True,
        has_pilot: bool = True,
        parameters: Mapping[str, float] | None = None,
    ) -> None:
        config = Config()
        values = {**loaded(autopilot), **(parameters or {})}
        setup = Setup(WORLD, "room_100", 1, config.sensors, autopilot, parameters=values)
        sitl_end, companion_end = direct_pair(setup.system_id)
        self.simulation = Simulation(setup, [sitl_end])
        self.autopilot = self.simulation.autopilot
        self.here, self.taking_over = SWITCH[autopilot]
        self.autopilot.switch_transmitter(on=transmitter)
        self.switch(self.here)
        wires = self.simulation.board.bus
        self.examination = Examination(config, companion_end, wires, needs_pilot=has_pilot)
        loss_s = config.link.setpoint_loss_s
        self.rehearsal = Rehearsal(self.examination, loss_s, has_pilot=has_pilot)
        self._acts, self._prompt = dict(acts or {}), ""
        self.pilot_obeys = True
        self.each_tick: Callable[[], None] = lambda: None

    def switch(self, mode: int) -> None:
        self.autopilot.pilot_mode(mode, Throttle.MID)

    def run(self) -> dict[str, Finding]:
        while not self.rehearsal.is_over:
            self.tick()
            assert self.simulation.time_s < 200
        return {line.part: line for line in self.rehearsal.lines}

    def tick(self) -> None:
        if act := self._acts.pop(self.rehearsal.stage, None):
            act(self)
        self._obey(self.rehearsal.prompt)
        self.each_tick()
        self.simulation.advance(self.simulation.time_s + TICK_S)
        self.rehearsal.step(self.simulation.time_s)

    def _obey(self, prompt: str) -> None:
        if prompt == self._prompt or not self.pilot_obeys:
            return
        self._prompt = prompt
        if prompt:
            self.switch(self.taking_over if "take the drone" in prompt else self.here)

    @property
    def is_armed(self) -> bool:
        return self.examination.telemetry.vehicle.armed


@pytest.mark.parametrize(
    ("autopilot", "reaction"),
    [("ardupilot", "GUID_TIMEOUT 0.5 s is set"), ("px4", "LAND")],
)
def test_a_sound_drone_passes_line_by_line_and_never_leaves_the_ground(
    autopilot: str, reaction: str
) -> None:
    drone = Rehearsed(autopilot)
    lines = drone.run()
    assert {line.verdict for line in lines.values()} == {CheckResult.GOOD}
    assert drone.rehearsal.has_passed
    named = [line.part for line in drone.rehearsal.lines]
    assert named[-10:] == [
        *("link rate", "mode", "switch taken", "not taken back", "switch given", "mode again"),
        *("arm", "motors on", "setpoint loss", "disarm"),
    ]
    assert reaction in lines["setpoint loss"].seen
    assert not drone.is_armed
    assert drone.simulation.record.air_time_s == 0


def test_a_drone_that_flies_without_a_pilot_is_rehearsed_without_one() -> None:
    drone = Rehearsed(transmitter=False, has_pilot=False)
    drone.switch(STABILIZE)
    lines = drone.run()
    assert drone.rehearsal.has_passed
    assert lines["switch taken"].seen == "by nobody: preflight.transmitter = false"
    assert "switch given" not in lines
    assert not drone.is_armed


def does(action: Action) -> Act:
    return lambda drone: action.begin(drone.simulation)


def switches_to(mode: int) -> Act:
    return lambda drone: drone.switch(mode)


def has_a_wrong_switch(drone: Rehearsed) -> None:
    drone.taking_over = STABILIZE


def stands_still(drone: Rehearsed) -> None:
    drone.pilot_obeys = False


def is_slowed(drone: Rehearsed) -> None:
    """A ground station sets its own rate every second."""

    def ask() -> None:
        if round(drone.simulation.time_s / TICK_S) % 20 == 0:
            other_rates("ATTITUDE", 1).begin(drone.simulation)

    drone.each_tick = ask


def cuts_the_link(drone: Rehearsed) -> None:
    drone.simulation.disturb_link(LinkErrors(loss=1.0))


@pytest.mark.parametrize(
    ("stage", "act", "part", "words"),
    [
        (Stage.PARTS, does(unplug("left")), "left", "outside the output range"),
        (Stage.PARTS, does(battery(15)), "battery", "15 % left"),
        (Stage.PARTS, is_slowed, "link rate", "no steady ATTITUDE"),
        (Stage.PARTS, switches_to(STABILIZE), "autopilot", "its mode is STABILIZE"),
        (Stage.MODE, cuts_the_link, "mode", "no reaction"),
        (Stage.TAKE, stands_still, "switch taken", "no change of mode"),
        (Stage.TAKE, has_a_wrong_switch, "switch taken", "leads to STABILIZE"),
        (Stage.QUIET, switches_to(GUIDED), "not taken back", "GUIDED again"),
        (Stage.GIVE, stands_still, "switch given", "LOITER for 5 s"),
        (Stage.GIVE, does(pilot_arms()), "mode again", "armed already"),
        (Stage.ARM, does(refuse_arming()), "arm", "Compass not calibrated"),
        (Stage.SILENCE, does(unplug("up")), "up", "motors on"),
        (Stage.DISARM, cuts_the_link, "disarm", "no reaction"),
    ],
)
def test_each_fault_fails_its_own_line_and_has_a_remedy(
    stage: Stage, act: Act, part: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rehearsal, "PARTS_TIMEOUT_S", 8.0)
    monkeypatch.setattr(rehearsal, "PILOT_TIMEOUT_S", 5.0)
    drone = Rehearsed(acts={stage: act})
    line = drone.run()[part]
    assert line.verdict is CheckResult.BAD
    assert words in line.seen
    assert line.remedy
    assert not drone.rehearsal.has_passed
    assert drone.simulation.record.air_time_s == 0


@pytest.mark.parametrize(
    ("autopilot", "parameters", "words"),
    [
        ("px4", {"COM_RCL_EXCEPT": 4.0}, ("ignored in flight", "COM_RCL_EXCEPT = 4")),
        ("px4", {"COM_RC_IN_MODE": 4.0}, ("ignored in flight", "COM_RC_IN_MODE")),
        ("px4", {"NAV_RCL_ACT": 2.0, "RTL_RETURN_ALT": 60.0}, ("climbs to 60 m", "NAV_RCL_ACT")),
        ("px4", {"NAV_RCL_ACT": 6.0}, ("falls", "NAV_RCL_ACT")),
        ("ardupilot", {"FS_THR_ENABLE": 0.0}, ("ignored in flight", "FS_THR_ENABLE")),
        ("ardupilot", {"FS_OPTIONS": 4.0}, ("ignored in flight", "FS_OPTIONS")),
        ("ardupilot", {"FS_THR_ENABLE": 1.0, "RTL_ALT": 1500.0}, ("climbs to 15 m", "ENABLE")),
    ],
)
def test_a_drone_that_would_not_land_without_its_transmitter_fails(
    autopilot: str,
    parameters: Mapping[str, float],
    words: tuple[str, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rehearsal, "PARTS_TIMEOUT_S", 3.0)
    line = Rehearsed(autopilot, parameters=parameters).run()["transmitter loss"]
    assert line.verdict is CheckResult.BAD
    assert words[0] in line.seen
    assert words[1] in line.seen + line.remedy
    assert "deploy/" in line.remedy


def test_without_a_transmitter_nothing_is_armed() -> None:
    drone = Rehearsed(transmitter=False)
    line = drone.run()["autopilot"]
    assert "no transmitter" in line.seen
    assert "switch the transmitter on" in line.remedy
    assert {line.part for line in drone.rehearsal.lines}.isdisjoint({"mode", "arm"})


def test_the_motors_stop_after_an_interruption() -> None:
    drone = Rehearsed(acts={Stage.SILENCE: lambda drone: drone.rehearsal.interrupt()})
    lines = drone.run()
    assert not drone.rehearsal.has_passed
    assert lines["setpoint loss"].seen == "interrupted"
    assert lines["disarm"].verdict is CheckResult.GOOD
    assert not drone.is_armed


def test_an_arming_that_shows_late_is_still_undone() -> None:
    """An interruption right after the command: its effect shows with the next HEARTBEAT."""
    drone = Rehearsed(acts={Stage.ARM: lambda drone: None})
    while drone.rehearsal.stage is not Stage.ARM:
        drone.tick()
    for _ in range(12):
        drone.tick()
    drone.rehearsal.interrupt()
    drone.run()
    drone.simulation.advance(drone.simulation.time_s + 3)
    assert not drone.examination.listen(drone.simulation.time_s).armed


def test_a_pilot_who_takes_over_with_the_motors_on_is_not_contradicted() -> None:
    drone = Rehearsed(acts={Stage.SILENCE: switches_to(LOITER)})
    lines = drone.run()
    assert "handed over: mode changed to LOITER" in lines["setpoint loss"].seen
    assert "disarm it by the transmitter" in lines["setpoint loss"].remedy
    assert "disarm" not in lines
    assert drone.is_armed


def test_setpoints_of_another_program_hide_the_loss_and_are_found() -> None:
    other = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 0x05C7, *(0.0,) * 11
    )
    drone = Rehearsed("px4")
    drone.each_tick = lambda: drone.autopilot.receive(other)
    line = drone.run()["setpoint loss"]
    assert line.verdict is CheckResult.BAD
    assert "still OFFBOARD" in line.seen
    assert "another program" in line.remedy
    assert not drone.is_armed
