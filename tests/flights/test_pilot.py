"""Tests of the pilot's mode switch in every phase, on both autopilots, and of refused arming."""

from collections import Counter
from collections.abc import Callable

import pytest

from companion.link import requests
from companion.link.transports.transport import Message
from companion.pdps.flight.state import Phase
from sitl.simulation.simulation import Simulation
from sitl.testing import (
    Action,
    Event,
    Flight,
    Sitl,
    at,
    battery,
    claim,
    hang,
    link_down,
    mute,
    pilot_arms,
    pilot_mode,
    refuse_arming,
    stay_taking_off,
)
from sitl.testing import watch as each_tick
from sitl.testing.actions.vehicle import MODE_NAMES
from tests.worlds import SMALL_ROOM

MODE, ARM, TAKE_OFF, INTERVAL = 176, 400, 22, 511
BOTH = pytest.mark.parametrize(
    ("autopilot", "pilots"), [("ardupilot", "LOITER"), ("px4", "POSCTL")]
)
IN_FLIGHT_S, HEARTBEAT_S = 30.0, 1.1


class Watch:
    """Records the commands to the vehicle, and its modes."""

    def __init__(self) -> None:
        self.asked: list[tuple[float, int, float]] = []
        self.modes: list[str] = []
        self.armed_s = float("inf")
        self._now_s = 0.0

    def note(self, simulation: Simulation) -> None:
        autopilot = simulation.autopilot
        self._now_s = simulation.time_s
        mode = MODE_NAMES[autopilot.kind].get(autopilot.mode, "")
        if self.modes[-1:] != [mode]:
            self.modes.append(mode)

    def receive(self, command: int, first: float) -> None:
        if command != INTERVAL:
            self.asked.append((self._now_s, command, first))

    def after(self, time_s: float) -> Counter[int]:
        return Counter(command for when_s, command, _ in self.asked if when_s > time_s)

    def event(self) -> Event:
        return each_tick(lambda simulation, app: self.note(simulation))


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch) -> Watch:
    watching, was = Watch(), requests.command_long

    def command_long(
        target: tuple[int, int], command: int, given: tuple[float, ...], confirmation: int = 0
    ) -> Message:
        watching.receive(command, given[0])
        return was(target, command, given, confirmation)

    monkeypatch.setattr(requests, "command_long", command_long)
    return watching


Fly = Callable[..., Flight]


@pytest.fixture
def fly(sitl: Sitl, watch: Watch) -> Fly:
    def flown(*script: Event, world: str = "room_100", **more: object) -> Flight:
        return sitl.fly(world, script=[watch.event(), *script], **more)  # type: ignore[arg-type]

    return flown


def mode_of(flight: Flight) -> str:
    autopilot = flight.simulation.autopilot
    return MODE_NAMES[autopilot.kind][autopilot.mode]


@BOTH
@pytest.mark.parametrize("away_s", [1.5, 3.0, 6.0, 9.0])
def test_a_pilot_who_takes_over_during_a_link_loss_keeps_control(
    fly: Fly, watch: Watch, autopilot: str, pilots: str, away_s: float
) -> None:
    taken_s = IN_FLIGHT_S + 0.3
    flight = fly(
        at(IN_FLIGHT_S, link_down(for_s=away_s)),
        at(taken_s, pilot_mode(pilots, throttle="mid")),
        autopilot=autopilot,
    )
    assert flight.ending == f"handed over: mode changed to {pilots}"
    assert mode_of(flight) == pilots
    assert watch.after(IN_FLIGHT_S) == {}


@BOTH
@pytest.mark.parametrize("mode", ["LAND", "RTL"])
def test_land_and_rtl_by_the_pilot_hand_over_control(
    fly: Fly, watch: Watch, autopilot: str, pilots: str, mode: str
) -> None:
    flight = fly(at(IN_FLIGHT_S, pilot_mode(mode)), autopilot=autopilot)
    assert flight.ending == f"handed over: mode changed to {mode}"
    assert flight.simulation.time_s < IN_FLIGHT_S + HEARTBEAT_S + 0.1
    assert watch.after(IN_FLIGHT_S) == {}


@BOTH
def test_a_pilot_who_takes_over_while_arming_is_refused_keeps_control(
    fly: Fly, watch: Watch, autopilot: str, pilots: str
) -> None:
    flight = fly(at(0, refuse_arming(for_s=18)), at(12, pilot_mode(pilots)), autopilot=autopilot)
    assert flight.ending == f"handed over: mode changed to {pilots}"
    assert watch.after(12 + HEARTBEAT_S) == {}
    assert MODE in watch.after(0)


@BOTH
@pytest.mark.parametrize("armed_s", [3.0, 8.3, 8.7])
def test_a_drone_armed_by_the_pilot_is_not_flown(
    fly: Fly, watch: Watch, autopilot: str, pilots: str, armed_s: float
) -> None:
    """The pilot arms while the drone waits for the gyro, or while arming is refused."""
    flight = fly(at(0, refuse_arming()), at(armed_s, pilot_arms()), autopilot=autopilot)
    assert flight.app.flight.phase is Phase.FAILED
    assert "armed" in flight.ending
    assert watch.after(armed_s + HEARTBEAT_S) == {}
    assert flight.truth.path[-1].position_ned_m[2] == 0


@BOTH
def test_a_pilot_who_takes_over_during_landing_keeps_control(
    fly: Fly, watch: Watch, autopilot: str, pilots: str
) -> None:
    lands = Event(lambda s, app: watch.modes[-1:] == ["LAND"], pilot_mode(pilots, "mid"))
    flight = fly(at(IN_FLIGHT_S, battery(5)), lands, autopilot=autopilot)
    assert flight.app.flight.phase is Phase.HANDED_OVER
    assert mode_of(flight) == pilots


def test_the_companion_does_not_interrupt_px4_landing_after_late_setpoints(
    fly: Fly, watch: Watch
) -> None:
    """Further setpoints would return PX4 to OFFBOARD."""
    flight = fly(at(IN_FLIGHT_S, hang(for_s=2.5)), autopilot="px4")
    late = "the computer is starved: ticks 2.5 s late"
    assert flight.ending == f"handed over: mode changed to LAND; {late}"
    assert mode_of(flight) == "LAND"
    assert watch.after(IN_FLIGHT_S) == {}


def test_the_flight_continues_if_px4_returns_to_offboard_before_its_next_heartbeat(
    fly: Fly, watch: Watch
) -> None:
    """PX4 sends HEARTBEAT at whole seconds."""
    flight = fly(at(IN_FLIGHT_S + 0.05, hang(for_s=0.8)), world=SMALL_ROOM, autopilot="px4")
    assert flight.completed, flight.ending
    assert watch.modes.count("OFFBOARD") == 2


# Refused before arming


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (claim(vehicle="GROUND_ROVER"), "a ground rover at"),
        (claim(vehicle="FIXED_WING"), "a fixed wing at"),
        (claim(autopilot="GENERIC"), "unsupported autopilot GENERIC at"),
        (claim(autopilot="INVALID"), "no autopilot at"),
        (battery(15), "15 % of the battery is left"),
        (mute("EXTENDED_SYS_STATE"), "it does not report whether it has landed"),
        (mute("HEARTBEAT"), "no HEARTBEAT from an autopilot"),
    ],
)
def test_an_unsuitable_vehicle_is_refused_with_the_reason(
    fly: Fly, watch: Watch, autopilot: str, fault: Action, words: str
) -> None:
    flight = fly(at(0, fault), autopilot=autopilot)
    assert flight.app.flight.phase is Phase.FAILED
    assert words in flight.ending
    assert watch.asked == []


def test_a_wrong_system_id_is_reported(fly: Fly, watch: Watch) -> None:
    flight = fly(parameters={"SYSID_THISMAV": 3})
    assert "system 3 sends there, not 1: link.system_id" in flight.ending
    assert watch.asked == []


def test_the_mission_begins_although_the_autopilot_keeps_reporting_take_off(
    fly: Fly, watch: Watch
) -> None:
    flight = fly(at(0, stay_taking_off()), world=SMALL_ROOM)
    assert flight.completed, flight.ending
    assert watch.after(0)[TAKE_OFF] == 1
