"""Tests that the emulated autopilot responds as measured on ArduCopter 4.6.3."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import wrap_rad
from sitl.autopilot.core import Autopilot
from tests.unit.sitl.autopilot.client import (
    ACCEPTED,
    DENIED,
    FAILED,
    ORIGIN,
    START,
    UNSUPPORTED,
    Client,
    kinds,
)


@pytest.fixture
def client() -> Client:
    return Client()


def test_only_heartbeats_at_1_hz_are_sent_without_a_request(client: Client) -> None:
    received = client.waits(5)
    assert kinds(received) == ["HEARTBEAT"] * 5
    assert (received[0].type, received[0].autopilot, received[0].base_mode) == (2, 3, 81)


def test_heartbeats_follow_mode_and_arming(client: Client) -> None:
    client.waits(5)
    received = client.commands(176, 1, 4)
    assert [(m.base_mode, m.custom_mode) for m in received if m.get_type() == "HEARTBEAT"] == [
        (89, 4)
    ]
    client.sends(ORIGIN)
    client.result(400, 1)
    assert client.waits(1)[-1].base_mode == 217


@pytest.mark.parametrize(
    ("parameters", "result"), [((1, 4), ACCEPTED), ((0, 4), DENIED), ((1, 99), FAILED)]
)
def test_do_set_mode_is_accepted_denied_or_failed(
    client: Client, parameters: tuple[int, int], result: int
) -> None:
    assert client.result(176, *parameters) == result


def test_the_ack_comes_before_the_text_that_explains_it(client: Client) -> None:
    received = client.commands(176, 1, 99)
    assert kinds(received) == ["COMMAND_ACK", "STATUSTEXT"]
    assert received[1].text == "No such mode 99"


def test_arming_is_refused_without_origin_even_by_force(client: Client) -> None:
    client.waits(5)
    received = client.commands(400, 1)
    assert received[0].result == FAILED
    assert (received[1].severity, received[1].text) == (2, "Arm: AHRS: waiting for home")
    received = client.commands(400, 1, 2989)
    assert (received[0].result, received[1].text) == (FAILED, "Arm: Need Position Estimate")


def test_local_position_is_not_sent_before_it_is_known(client: Client) -> None:
    client.waits(5)
    assert client.result(511, 32, 50_000) == ACCEPTED
    assert "LOCAL_POSITION_NED" not in kinds(client.waits(2))
    client.sends(ORIGIN)
    assert kinds(client.waits(1)).count("LOCAL_POSITION_NED") == 20


@pytest.mark.parametrize(
    ("message_id", "interval_us", "result"),
    [(30, 20_000, ACCEPTED), (30, 4_000, ACCEPTED), (30, 1_000, DENIED), (4242, 20_000, DENIED)],
)
def test_message_intervals_are_accepted_within_limits(
    client: Client, message_id: int, interval_us: int, result: int
) -> None:
    assert client.result(511, message_id, interval_us) == result


def test_a_message_interval_can_be_read_and_disabled(client: Client) -> None:
    client.result(511, 30, 20_000)
    assert kinds(client.waits(1)).count("ATTITUDE") == 50
    received = client.commands(510, 30)
    assert [m.interval_us for m in received if m.get_type() == "MESSAGE_INTERVAL"] == [20_000]
    client.result(511, 30, -1)
    assert "ATTITUDE" not in kinds(client.waits(1))


def test_request_message_returns_the_message_or_fails(client: Client) -> None:
    received = client.commands(512, 148)
    assert {m.capabilities for m in received if m.get_type() == "AUTOPILOT_VERSION"} == {64495}
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
        (1, 0x07C7, True),
    ],
)
def test_ardupilot_flies_setpoints_only_with_a_valid_frame_and_mask(
    client: Client, frame: int, mask: int, flies: bool
) -> None:
    client.flies()
    for _ in range(40):
        client.velocity(frame=frame, mask=mask)
        client.waits(0.05)
    assert (client.speed() > 0.7) == flies


@pytest.mark.parametrize("value", [math.nan, math.inf, 2000.0])
def test_invalid_velocities_stop_the_vehicle(client: Client, value: float) -> None:
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


def test_the_last_setpoint_is_flown_for_three_seconds_before_braking(client: Client) -> None:
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


def test_the_position_estimate_drifts_by_less_than_2_m(client: Client) -> None:
    client.flies()
    client.result(511, 32, 100_000)
    for _ in range(200):
        client.velocity(frame=8, mask=0x05C7, vx=0.5)
        received = client.waits(0.05)
    estimate = [m for m in received if m.get_type() == "LOCAL_POSITION_NED"][-1]
    truth = client.autopilot.truth.position_ned_m
    error_m = math.dist((estimate.x, estimate.y), truth[:2])
    assert 0.01 < error_m < 2.0


def test_a_crash_is_reported_and_prevents_arming(client: Client) -> None:
    client.flies()
    client.autopilot.crash("hit an obstacle")
    received = client.waits(3)
    assert "Crash: hit an obstacle" in [m.text for m in received if m.get_type() == "STATUSTEXT"]
    assert client.autopilot.truth.position_ned_m[2] == 0
    assert client.result(400, 1) == FAILED


def turned_deg(client: Client, seconds: float, *, frame: int, mask: int, yaw: float) -> float:
    """Change of the heading while these setpoints are sent at 20 Hz, deg."""
    began = client.autopilot.truth.yaw_rad
    turned = 0.0
    for _ in range(round(seconds * 20)):
        client.sends(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, mask, 0, 0, 0, 0, 0, 0, 0, 0, 0, yaw, 0
            )
        )
        client.waits(0.05)
        now = client.autopilot.truth.yaw_rad
        turned += math.degrees(wrap_rad(now - began))
        began = now
    return turned


def test_a_commanded_yaw_in_ned_is_absolute(client: Client) -> None:
    client.flies()
    to_go = math.degrees(wrap_rad(2.0 - client.autopilot.estimate.yaw_rad))
    turned = turned_deg(client, 4, frame=1, mask=0x09C7, yaw=2.0)
    assert turned == pytest.approx(to_go, abs=8)


def test_a_relative_yaw_is_applied_again_at_every_packet(client: Client) -> None:
    client.flies()
    assert turned_deg(client, 8, frame=9, mask=0x09C7, yaw=0.5) > 360


def test_the_vehicle_faces_its_course_without_a_commanded_yaw(client: Client) -> None:
    client.flies()
    for _ in range(80):
        client.velocity(frame=1, mask=0x0DC7, vx=-1.0)
        client.waits(0.05)
    assert abs(client.autopilot.estimate.yaw_rad) == pytest.approx(math.pi, abs=0.2)


def test_a_position_setpoint_is_reached(client: Client) -> None:
    client.flies()
    for _ in range(200):
        client.sends(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, 1, 0x0DF8, 3, -2, -2, 0, 0, 0, 0, 0, 0, 0, 0
            )
        )
        client.waits(0.05)
    north, east, _ = client.autopilot.truth.position_ned_m
    assert (north, east) == pytest.approx((3, -2), abs=0.8)


def test_a_setpoint_with_velocity_and_acceleration_is_flown_by_velocity(client: Client) -> None:
    client.flies()
    for _ in range(40):
        client.velocity(frame=1, mask=0x0C07)
        client.waits(0.05)
    assert client.speed() > 0.7


def test_forced_disarming_drops_the_vehicle(client: Client) -> None:
    client.flies()
    assert client.result(400, 0, 21196) == ACCEPTED
    client.waits(2)
    assert client.autopilot.truth.position_ned_m[2] == 0


def test_an_origin_of_zeros_does_not_count(client: Client) -> None:
    client.waits(5)
    client.sends(mavlink.MAVLink_set_gps_global_origin_message(1, 0, 0, 0))
    assert client.result(512, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN) == FAILED


def test_states_are_reported_from_boot_to_flight(client: Client) -> None:
    assert client.waits(1)[-1].system_status == mavlink.MAV_STATE_BOOT
    client.flies()
    beats = [m for m in client.waits(1) if m.get_type() == "HEARTBEAT"]
    assert beats[-1].system_status == mavlink.MAV_STATE_ACTIVE
    received = client.commands(512, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    assert [m.landed_state for m in received if m.get_type() == "EXTENDED_SYS_STATE"] == [2]


def test_a_take_off_begins_after_a_second_and_settles_at_its_height(client: Client) -> None:
    client.is_ready()
    client.result(400, 1)
    client.result(22, 0, 0, 0, 0, 0, 0, 2)
    client.waits(0.9)
    assert client.autopilot.truth.position_ned_m[2] == 0
    fastest = 0.0
    for _ in range(60):
        client.waits(0.1)
        fastest = max(fastest, -client.autopilot.truth.velocity_ned_m_s[2])
    assert fastest == pytest.approx(1.2, abs=0.1)
    assert -client.autopilot.truth.position_ned_m[2] == pytest.approx(2.0, abs=0.1)


def test_command_int_is_accepted(client: Client) -> None:
    received = client.sends(
        mavlink.MAVLink_command_int_message(1, 1, 0, 176, 0, 0, 1, 4, 0, 0, 0, 0, 0)
    )
    assert [m.result for m in received if m.get_type() == "COMMAND_ACK"] == [ACCEPTED]
    assert client.autopilot.mode == 4


def test_request_data_stream_starts_a_stream(client: Client) -> None:
    client.sends(mavlink.MAVLink_request_data_stream_message(1, 1, 10, 10, 1))
    assert kinds(client.waits(1)).count("ATTITUDE") == 10


def test_missions_and_files_are_reported_as_absent(client: Client) -> None:
    received = client.sends(mavlink.MAVLink_mission_request_list_message(1, 1))
    assert [m.count for m in received] == [0]
    opened = bytes((5, 0, 0, 4)) + bytes(247)
    (answer,) = client.sends(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, opened))
    assert (answer.payload[0], answer.payload[3], answer.payload[5]) == (6, 129, 4)


def test_each_link_has_its_own_streams_and_answers() -> None:
    autopilot = Autopilot(1, START, links=2)
    ask = mavlink.MAVLink_command_long_message(1, 1, 511, 0, 30, 20_000, 0, 0, 0, 0, 0)
    autopilot.receive(ask, link=1)
    for _ in range(100):
        autopilot.step()
    first, second = kinds(autopilot.take_outbox(0)), kinds(autopilot.take_outbox(1))
    assert (first.count("ATTITUDE"), second.count("ATTITUDE")) == (0, 50)
    assert ("COMMAND_ACK" in first, "COMMAND_ACK" in second) == (False, True)
    assert "HEARTBEAT" in first
    assert "HEARTBEAT" in second


def test_ground_truth_is_not_sent(client: Client) -> None:
    assert client.result(511, mavlink.MAVLINK_MSG_ID_SIM_STATE, 20_000) == DENIED
