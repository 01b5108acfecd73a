"""The emulated autopilot answers as ArduCopter 4.6.3 was seen to answer."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.unit.autopilot_client import ACCEPTED, DENIED, FAILED, UNSUPPORTED, Client, kinds


@pytest.fixture
def client() -> Client:
    return Client()


def test_unasked_it_only_beats_once_a_second(client: Client) -> None:
    heard = client.waits(5)
    assert kinds(heard) == ["HEARTBEAT"] * 5
    assert (heard[0].type, heard[0].autopilot, heard[0].base_mode) == (2, 3, 81)


def test_heartbeats_follow_mode_and_arming(client: Client) -> None:
    client.waits(5)
    heard = client.commands(176, 1, 4)
    assert [(m.base_mode, m.custom_mode) for m in heard if m.get_type() == "HEARTBEAT"] == [(89, 4)]
    client.sends(mavlink.MAVLink_set_gps_global_origin_message(1, 0, 0, 0))
    client.result(400, 1)
    assert client.waits(1)[-1].base_mode == 217


@pytest.mark.parametrize(
    ("parameters", "result"), [((1, 4), ACCEPTED), ((0, 4), DENIED), ((1, 99), FAILED)]
)
def test_setting_the_mode(client: Client, parameters: tuple[int, int], result: int) -> None:
    assert client.result(176, *parameters) == result


def test_the_ack_comes_before_the_text_that_explains_it(client: Client) -> None:
    heard = client.commands(176, 1, 99)
    assert kinds(heard) == ["COMMAND_ACK", "STATUSTEXT"]
    assert heard[1].text == "No such mode 99"


def test_arming_is_refused_without_origin_even_by_force(client: Client) -> None:
    client.waits(5)
    heard = client.commands(400, 1)
    assert heard[0].result == FAILED
    assert (heard[1].severity, heard[1].text) == (2, "Arm: AHRS: waiting for home")
    heard = client.commands(400, 1, 2989)
    assert (heard[0].result, heard[1].text) == (FAILED, "Arm: Need Position Estimate")


def test_the_position_is_silent_until_there_is_one(client: Client) -> None:
    client.waits(5)
    assert client.result(511, 32, 50_000) == ACCEPTED
    assert "LOCAL_POSITION_NED" not in kinds(client.waits(2))
    client.sends(mavlink.MAVLink_set_gps_global_origin_message(1, 0, 0, 0))
    assert kinds(client.waits(1)).count("LOCAL_POSITION_NED") == 20


@pytest.mark.parametrize(
    ("message_id", "interval_us", "result"),
    [(30, 20_000, ACCEPTED), (30, 4_000, ACCEPTED), (30, 1_000, DENIED), (4242, 20_000, DENIED)],
)
def test_message_intervals(client: Client, message_id: int, interval_us: int, result: int) -> None:
    assert client.result(511, message_id, interval_us) == result


def test_an_interval_can_be_asked_and_stopped(client: Client) -> None:
    client.result(511, 30, 20_000)
    assert kinds(client.waits(1)).count("ATTITUDE") == 50
    heard = client.commands(510, 30)
    assert [m.interval_us for m in heard if m.get_type() == "MESSAGE_INTERVAL"] == [20_000]
    client.result(511, 30, -1)
    assert "ATTITUDE" not in kinds(client.waits(1))


def test_requested_messages(client: Client) -> None:
    heard = client.commands(512, 148)
    assert {m.capabilities for m in heard if m.get_type() == "AUTOPILOT_VERSION"} == {64495}
    assert client.result(512, 4242) == FAILED


def test_unknown_commands_are_unsupported(client: Client) -> None:
    assert client.result(31999) == UNSUPPORTED


def test_timesync_is_answered(client: Client) -> None:
    (answer,) = client.sends(mavlink.MAVLink_timesync_message(0, 1234))
    assert answer.ts1 == 1234


def test_take_off_needs_arming_and_reaches_its_height(client: Client) -> None:
    client.is_ready()
    assert client.result(22, 0, 0, 0, 0, 0, 0, 2) == FAILED
    assert client.result(400, 1) == ACCEPTED
    assert client.result(22, 0, 0, 0, 0, 0, 0, 2) == ACCEPTED
    client.waits(8)
    assert -client.autopilot.truth.position_ned_m[2] == pytest.approx(2, abs=0.2)
    assert client.result(22, 0, 0, 0, 0, 0, 0, 2) == FAILED


def test_disarming_in_the_air_fails(client: Client) -> None:
    client.flies()
    assert client.result(400, 0) == FAILED


def test_landing_ends_disarmed_on_the_ground(client: Client) -> None:
    client.flies()
    assert client.result(21) == ACCEPTED
    assert client.autopilot.mode == 9
    client.waits(10)
    assert client.autopilot.truth.position_ned_m[2] == 0
    assert not client.waits(1)[-1].base_mode & 128


@pytest.mark.parametrize(
    ("frame", "mask", "flies"),
    [
        (8, 0x05C7, True),
        (9, 0x05C7, True),
        (1, 0x05C7, True),
        (7, 0x05C7, True),
        (1, 0x0DC7, True),
        (12, 0x05C7, False),
        (8, 0x05CF, False),
        (1, 0x07C7, False),
    ],
)
def test_frames_and_masks_of_setpoints(client: Client, frame: int, mask: int, flies: bool) -> None:
    client.flies()
    for _ in range(40):
        client.velocity(frame=frame, mask=mask)
        client.waits(0.05)
    assert (client.speed() > 0.7) == flies


@pytest.mark.parametrize("value", [math.nan, math.inf, 2000.0])
def test_absurd_velocities_stop_it(client: Client, value: float) -> None:
    client.flies()
    for _ in range(20):
        client.velocity(frame=8, mask=0x05C7)
        client.waits(0.05)
    for _ in range(40):
        client.velocity(frame=8, mask=0x05C7, vx=value)
        client.waits(0.05)
    assert client.speed() < 0.3


def test_body_velocity_follows_the_heading(client: Client) -> None:
    client.flies()
    for _ in range(40):
        client.velocity(frame=8, mask=0x05C7)
        client.waits(0.05)
    north, east, _ = client.autopilot.truth.velocity_ned_m_s
    course = math.atan2(east, north) - client.autopilot.truth.yaw_rad
    assert math.degrees(course) == pytest.approx(0, abs=8)


def test_a_lost_setpoint_is_flown_for_three_seconds_then_braked(client: Client) -> None:
    client.flies()
    for _ in range(60):
        client.velocity(frame=8, mask=0x05C7)
        client.waits(0.05)
    cruise = client.speed()
    client.waits(2.8)
    assert client.speed() == pytest.approx(cruise, abs=0.1)
    client.waits(0.75)
    assert client.speed() == pytest.approx(0.54 * cruise, abs=0.15)
    client.waits(3)
    assert client.speed() < 0.2
    assert client.autopilot.mode == 4


def test_the_setpoint_timeout_can_be_set(client: Client) -> None:
    client.flies()
    client.sets("GUID_TIMEOUT", 0.5)
    for _ in range(60):
        client.velocity(frame=8, mask=0x05C7)
        client.waits(0.05)
    client.waits(2)
    assert client.speed() < 0.2


def test_setpoints_on_the_ground_are_ignored(client: Client) -> None:
    client.is_ready()
    client.result(400, 1)
    for _ in range(20):
        client.velocity(frame=8, mask=0x05C7)
        client.waits(0.05)
    assert client.autopilot.truth.position_ned_m == (0, 0, 0)


def test_setpoints_outside_guided_are_ignored(client: Client) -> None:
    client.flies()
    client.autopilot.pilot_mode(5)
    for _ in range(20):
        client.velocity(frame=8, mask=0x05C7)
        client.waits(0.05)
    assert client.speed() < 0.2


def test_the_estimate_drifts_but_stays_near(client: Client) -> None:
    client.flies()
    client.result(511, 32, 100_000)
    for _ in range(200):
        client.velocity(frame=8, mask=0x05C7, vx=0.5)
        heard = client.waits(0.05)
    estimate = [m for m in heard if m.get_type() == "LOCAL_POSITION_NED"][-1]
    truth = client.autopilot.truth.position_ned_m
    error_m = math.dist((estimate.x, estimate.y), truth[:2])
    assert 0.01 < error_m < 2.0


def test_a_crash_is_told_and_final(client: Client) -> None:
    client.flies()
    client.autopilot.crash("hit an obstacle")
    heard = client.waits(3)
    assert "Crash: hit an obstacle" in [m.text for m in heard if m.get_type() == "STATUSTEXT"]
    assert client.autopilot.truth.position_ned_m[2] == 0
    assert client.result(400, 1) == FAILED
