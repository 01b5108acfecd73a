"""Tests of the pilot's modes by throttle position, compared with the real autopilots."""

from random import Random

import pytest

from sitl.autopilot.firmware import Throttle
from sitl.bench.fault_cases import FAULTS
from sitl.testing import pilot_mode
from sitl.testing.actions.vehicle import MODE_NAMES, ModeError
from tests.unit.sitl.autopilot.client import ACCEPTED, Client
from tests.unit.sitl.autopilot.test_px4 import offboard, stream

LOW, MID = Throttle.LOW, Throttle.MID
NUMBERS = {k: {name: n for n, name in names.items()} for k, names in MODE_NAMES.items()}
GROUND_TOUCHED_S = 1.3


def flying(kind: str) -> Client:
    client = Client(kind)
    return offboard(client) if kind == "px4" else client.flies()


def height_m(client: Client) -> float:
    return -client.autopilot.truth.position_ned_m[2]


def is_armed(client: Client) -> bool:
    beat = [m for m in client.waits(1) if m.get_type() == "HEARTBEAT"][-1]
    return bool(beat.base_mode & 128)


@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        *(("ardupilot", mode) for mode in ("LOITER", "ALT_HOLD", "POSHOLD", "STABILIZE")),
        *(("px4", mode) for mode in ("POSCTL", "ALTCTL", "MANUAL", "STABILIZED")),
    ],
)
def test_low_throttle_descends_to_the_ground_without_disarming(kind: str, mode: str) -> None:
    client = flying(kind)
    client.autopilot.pilot_mode(NUMBERS[kind][mode])
    client.waits(3.0)
    assert height_m(client) == 0
    assert is_armed(client)


@pytest.mark.parametrize(
    ("kind", "mode", "down_m_s"),
    [("ardupilot", "LOITER", 2.2), ("px4", "POSCTL", 1.5)],
)
def test_the_sink_rate_at_low_throttle_matches_the_real_firmware(
    kind: str, mode: str, down_m_s: float
) -> None:
    client = flying(kind)
    client.autopilot.pilot_mode(NUMBERS[kind][mode], LOW)
    fastest_m_s = 0.0
    while height_m(client) > 0.05:
        client.waits(0.05)
        fastest_m_s = max(fastest_m_s, client.autopilot.truth.velocity_ned_m_s[2])
    assert 0.6 * down_m_s < fastest_m_s < 1.09 * down_m_s  # overshoot of 8 %


def test_px4_sinks_at_the_rate_of_its_parameter() -> None:
    client = flying("px4")
    client.sets("MPC_Z_VEL_MAX_DN", 0.5)
    client.autopilot.pilot_mode(NUMBERS["px4"]["ALTCTL"], LOW)
    client.waits(2.0)  # still climbing
    was_m = height_m(client)
    client.waits(1.0)
    assert was_m - height_m(client) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("kind", "mode", "stick"),
    [
        *(("ardupilot", mode, MID) for mode in ("LOITER", "ALT_HOLD", "POSHOLD", "STABILIZE")),
        *(("px4", mode, MID) for mode in ("POSCTL", "ALTCTL", "STABILIZED")),
        *(("ardupilot", mode, LOW) for mode in ("BRAKE", "RTL", "AUTO")),
        *(("px4", mode, LOW) for mode in ("HOLD", "RTL")),
    ],
)
def test_mid_throttle_and_automatic_modes_hold_the_height(
    kind: str, mode: str, stick: Throttle
) -> None:
    client = flying(kind)
    was_m = height_m(client)
    client.autopilot.pilot_mode(NUMBERS[kind][mode], stick)
    client.waits(1.5)  # comes to rest after the climb
    rests_at_m = height_m(client)
    assert was_m - 0.1 < rests_at_m < was_m + 0.3
    client.waits(5.0)
    assert height_m(client) == pytest.approx(rests_at_m, abs=0.2)


def test_mid_throttle_stops_the_descent() -> None:
    client = flying("ardupilot")
    loiter = NUMBERS["ardupilot"]["LOITER"]
    client.autopilot.pilot_mode(loiter, LOW)
    client.waits(0.5)
    client.autopilot.pilot_mode(loiter, MID)
    client.waits(4.0)
    assert height_m(client) > 0.5


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_the_vehicle_stays_on_the_ground_at_low_throttle(kind: str) -> None:
    client = Client(kind)
    client.waits(5)
    client.autopilot.pilot_arms()
    for mode in NUMBERS[kind].values():
        client.autopilot.pilot_mode(mode, LOW)
        client.waits(0.2)
        assert height_m(client) == 0


# Names


@pytest.mark.parametrize(("name", "throttle"), [("SLEEP", "mid"), ("LOITER", "high"), ("", "low")])
def test_an_unknown_mode_or_throttle_is_refused_with_the_known_names(
    name: str, throttle: str
) -> None:
    with pytest.raises(ModeError, match=r"known: .*(LOITER|mid)"):
        pilot_mode(name, throttle)


def test_the_fault_campaign_uses_modes_that_both_autopilots_have() -> None:
    do, draw = FAULTS["pilot takes over"]
    names = {draw(Random(seed))["name"] for seed in range(50)}
    assert do == "pilot_mode"
    assert len(names) > 1
    assert all(names <= set(numbers) for numbers in NUMBERS.values())


# PX4 after a setpoint timeout


def loses_setpoints(client: Client) -> int:
    """Stop the setpoints; return the mode that the autopilot enters."""
    client.waits(1.3)
    return client.autopilot.mode


def test_px4_returns_to_offboard_when_setpoints_resume() -> None:
    client = flying("px4")
    assert loses_setpoints(client) != NUMBERS["px4"]["OFFBOARD"]
    stream(client, 0.1)
    assert client.autopilot.mode == NUMBERS["px4"]["OFFBOARD"]


def test_px4_does_not_leave_the_pilots_mode_for_setpoints() -> None:
    client = flying("px4")
    loses_setpoints(client)
    client.autopilot.pilot_mode(NUMBERS["px4"]["LAND"])
    stream(client, 0.5)
    assert client.autopilot.mode == NUMBERS["px4"]["LAND"]


def test_px4_reports_a_new_mode_at_the_next_heartbeat_and_ardupilot_at_once() -> None:
    for kind, mode, at_once in (("px4", "POSCTL", False), ("ardupilot", "LOITER", True)):
        client = flying(kind)
        client.waits(0.2)
        while not any(m.get_type() == "HEARTBEAT" for m in client.waits(0.01)):
            pass
        client.autopilot.pilot_mode(NUMBERS[kind][mode], MID)
        soon = [m for m in client.waits(0.02) if m.get_type() == "HEARTBEAT"]
        assert bool(soon) == at_once
        later = [m for m in client.waits(1.0) if m.get_type() == "HEARTBEAT"]
        assert later[-1].custom_mode == NUMBERS[kind][mode]


def test_px4_stays_disarmed_after_landing_when_setpoints_resume() -> None:
    client = flying("px4")
    client.autopilot.pilot_mode(NUMBERS["px4"]["LAND"])
    client.waits(8)
    stream(client, 1.0)
    assert not is_armed(client)
    assert client.result(400, 1) == ACCEPTED
