"""Tests of both emulated autopilots: rows of the table in docs/autopilot.md."""

import math
import re
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import make_codec
from sitl.autopilot.core import FIRMWARES
from sitl.autopilot.estimation.ground_truth import sim_state
from sitl.autopilot.messages import Broadcast, Outbox
from tests.unit.sitl.autopilot.client import (
    ACCEPTED,
    DENIED,
    FAILED,
    ORIGIN,
    START,
    UNSUPPORTED,
    Client,
    as_float,
    kinds,
)

REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
ROOT = Path(__file__).parents[4]
FIRMWARE = pytest.mark.parametrize("firmware", list(FIRMWARES))


def settled(firmware: str) -> Client:
    client = Client(firmware)
    client.waits(5)
    client.sends(ORIGIN)
    return client


def requested(client: Client, message_id: int) -> Any:
    """The message that REQUEST_MESSAGE returns; None if the request is rejected."""
    kind = mavlink.mavlink_map[message_id].msgname
    return next((m for m in client.commands(512, message_id) if m.get_type() == kind), None)


def texts(received: list[Any]) -> list[str]:
    return [m.text for m in received if m.get_type() == "STATUSTEXT"]


# Identity


@FIRMWARE
def test_the_autopilot_is_component_1_of_its_system(firmware: str) -> None:
    client = Client(firmware, parameters={})
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in client.waits(1)} == {(1, 1)}


@pytest.mark.parametrize(
    ("firmware", "version", "bytewise"),
    [("ardupilot", 67502976, False), ("px4", 0x011100, True)],
)
def test_autopilot_version_reports_the_parameter_encoding(
    firmware: str, version: int, bytewise: bool
) -> None:
    answer = requested(Client(firmware), mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    assert version in (answer.flight_sw_version, answer.flight_sw_version >> 8)
    assert bool(answer.capabilities & 16) is bytewise
    assert Client(firmware).result(520) == ACCEPTED


# Modes


@pytest.mark.parametrize("mode", [0, 2, 4, 5, 9, 16, 17, 20])
def test_ardupilot_modes_are_set_by_number(mode: int) -> None:
    client = settled("ardupilot")
    assert client.result(176, 1, mode) == ACCEPTED
    beat = client.waits(1)[-1]
    assert (beat.custom_mode, beat.base_mode) == (mode, 89 if mode in (4, 20) else 81)


@pytest.mark.parametrize(
    ("main", "sub", "custom", "base"),
    [
        (1, 0, 65536, 81),
        (2, 0, 131072, 81),
        (3, 0, 196608, 81),
        (7, 0, 458752, 81),
        (4, 2, 33816576, 29),
        (4, 3, 50593792, 29),
        (4, 6, 100925440, 29),
    ],
)
def test_px4_modes_are_set_by_number(main: int, sub: int, custom: int, base: int) -> None:
    client = settled("px4")
    assert client.result(176, 1, main, sub) == ACCEPTED
    beat = [m for m in client.waits(1) if m.get_type() == "HEARTBEAT"][-1]
    assert (beat.custom_mode, beat.base_mode) == (custom, base)


def test_px4_in_offboard_is_neither_manual_nor_automatic() -> None:
    client = settled("px4")
    for _ in range(30):
        client.velocity(frame=8, mask=0x05C7, vx=0.0)
        client.waits(0.05)
    assert client.result(400, 1) == ACCEPTED
    assert client.result(176, 1, 6) == ACCEPTED
    beat = [m for m in client.waits(1) if m.get_type() == "HEARTBEAT"][-1]
    assert beat.base_mode == 128 | 17


# Messages sent


@FIRMWARE
def test_landed_state_follows_take_off_flight_and_landing(firmware: str) -> None:
    client = settled(firmware)
    client.result(511, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 100_000)
    if firmware == "ardupilot":
        client.result(176, 1, 4)
    client.result(400, 1)
    received = client.waits(1) + client.commands(22, 0, 0, 0, 0, 0, 0, 2.0) + client.waits(9)
    received += client.commands(21) + client.waits(12)
    states = [m.landed_state for m in received if m.get_type() == "EXTENDED_SYS_STATE"]
    steps = [s for i, s in enumerate(states) if i == 0 or s != states[i - 1]]
    assert steps == [
        mavlink.MAV_LANDED_STATE_ON_GROUND,
        mavlink.MAV_LANDED_STATE_TAKEOFF,
        mavlink.MAV_LANDED_STATE_IN_AIR,
        mavlink.MAV_LANDED_STATE_LANDING,
        mavlink.MAV_LANDED_STATE_ON_GROUND,
    ]


@FIRMWARE
def test_sys_status_reports_the_sensor_bits(firmware: str) -> None:
    client = Client(firmware)
    status = requested(client, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    inertial_and_flow = 1 | 2 | 4 | 0x40
    assert status.onboard_control_sensors_present == inertial_and_flow
    assert not status.onboard_control_sensors_health & 0x1000_0000
    fence = status.onboard_control_sensors_health & 0x10_0000
    assert bool(fence) is (firmware == "ardupilot")
    client.waits(5)
    client.sends(ORIGIN)
    client.waits(1)
    client.sends(mavlink.MAVLink_vision_position_estimate_message(0, 0, 0, 0, 0, 0, 0, [0] * 21))
    client.waits(0.1)
    status = requested(client, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    assert status.onboard_control_sensors_health & 0x1000_0000
    assert status.onboard_control_sensors_present & 0x80
    assert not status.onboard_control_sensors_present & 0x20


@FIRMWARE
def test_sys_status_reports_the_transmitter(firmware: str) -> None:
    client = Client(firmware)
    receiver = mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
    for on in (False, True, False):
        client.autopilot.switch_transmitter(on=on)
        status = requested(client, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
        assert bool(status.onboard_control_sensors_present & receiver) is on


@FIRMWARE
def test_the_battery_has_four_cells(firmware: str) -> None:
    battery = requested(Client(firmware), mavlink.MAVLINK_MSG_ID_BATTERY_STATUS)
    assert list(battery.voltages) == [4200] * 4 + [65535] * 6
    assert battery.battery_remaining == 100
    assert battery.current_battery == 1200


@FIRMWARE
def test_home_and_origin_are_reported_once_they_are_set(firmware: str) -> None:
    client = Client(firmware)
    client.waits(5)
    not_yet = DENIED if firmware == "px4" else FAILED
    for message_id in (242, 49):
        assert client.result(512, message_id) == not_yet
    assert client.result(410) == not_yet
    (announced,) = [m for m in client.sends(ORIGIN) if m.get_type() == "GPS_GLOBAL_ORIGIN"]
    assert announced.latitude == ORIGIN.latitude
    home = requested(client, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    assert (home.latitude, home.longitude) == (ORIGIN.latitude, ORIGIN.longitude)
    assert client.result(410) == ACCEPTED


def test_px4_estimator_flags_depend_on_the_position() -> None:
    client = Client("px4")
    position = mavlink.ESTIMATOR_POS_HORIZ_REL | mavlink.ESTIMATOR_VELOCITY_HORIZ
    assert not requested(client, mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags & position
    client.waits(5)
    flags = requested(client, mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags
    assert flags & position == position
    assert flags & mavlink.ESTIMATOR_CONST_POS_MODE  # at rest on the ground


def test_sim_state_floats_are_scaled_by_1e7() -> None:
    state = sim_state(START)
    assert state.lat == pytest.approx(state.lat_int, rel=1e-6)
    assert abs(state.lat_int) > 1e7


# Responses


@FIRMWARE
def test_an_ack_is_addressed_to_the_sender_of_the_command(firmware: str) -> None:
    client = Client(firmware)
    codec = make_codec(42, 77)
    message = mavlink.MAVLink_command_long_message(1, 1, 31999, 0, *[0] * 7)
    (asked,) = make_codec(1, 1).parse_buffer(bytearray(message.pack(codec)))
    client.autopilot.receive(asked)
    (ack,) = client.autopilot.take_outbox()
    assert (ack.target_system, ack.target_component) == (42, 77)


@FIRMWARE
def test_commands_for_another_system_are_ignored(firmware: str) -> None:
    message = mavlink.MAVLink_command_long_message(7, 1, 512, 0, 148, *[0] * 6)
    assert Client(firmware).sends(message) == []


def test_ardupilot_and_px4_refuse_invalid_intervals_differently() -> None:
    ardupilot, px4 = Client(), Client("px4")
    received = ardupilot.commands(511, 4242, 20_000)
    assert received[0].result == DENIED
    assert texts(received) == ["No ap_message for mavlink id (4242)"]
    assert kinds(px4.commands(511, 4242, 20_000)) == ["COMMAND_ACK"]
    assert px4.result(511, 4242, 20_000) == FAILED
    assert px4.result(511, 30, 1_000) == ACCEPTED


def test_a_long_text_is_split_into_chunks_of_50() -> None:
    outbox = Outbox()
    Broadcast([outbox]).text(2, "x" * 120)
    chunks = outbox.take()
    assert [len(m.text) for m in chunks] == [50, 50, 20]
    assert [m.chunk_seq for m in chunks] == [0, 1, 2]
    assert len({m.id for m in chunks}) == 1
    assert chunks[0].id


@FIRMWARE
def test_the_autopilot_requests_timesync(firmware: str) -> None:
    asked = [m for m in Client(firmware).waits(20) if m.get_type() == "TIMESYNC"]
    assert len(asked) >= 2
    assert all(m.tc1 == 0 and m.ts1 > 0 for m in asked)


def test_prearm_checks_report_why_arming_would_be_refused() -> None:
    client = Client()
    client.waits(5)
    received = client.commands(401)
    assert received[0].result == ACCEPTED
    assert texts(received) == ["PreArm: AHRS: waiting for home"]


@FIRMWARE
def test_disarming_in_the_air_is_refused_without_text_unless_forced(firmware: str) -> None:
    client = settled(firmware)
    if firmware == "ardupilot":
        client.result(176, 1, 4)
    client.result(400, 1)
    client.result(22, *[math.nan] * 6, 2.0)
    client.waits(6)
    received = client.commands(400, 0)
    assert received[0].result == (FAILED if firmware == "ardupilot" else REJECTED)
    assert texts(received) == []
    assert client.result(400, 0, 21196) == ACCEPTED
    client.waits(3)
    assert client.autopilot.truth.position_ned_m[2] == 0


def test_switching_the_ekf_source_by_command_is_unsupported() -> None:
    assert Client().result(42007, 1) == UNSUPPORTED


# Flight


def test_the_last_yaw_rate_is_flown_for_three_seconds() -> None:
    client = Client().flies()
    for _ in range(20):
        client.velocity(frame=8, mask=0x05C7, vx=0.0, yaw_rate=0.5)
        client.waits(0.05)
    client.waits(2.8)
    assert client.autopilot.truth.yaw_rate_rad_s == pytest.approx(0.5, abs=0.05)
    received = client.waits(1.5)
    assert client.autopilot.truth.yaw_rate_rad_s == pytest.approx(0.0, abs=0.05)
    assert texts(received) == []


def test_the_setpoint_timeout_is_at_least_0_1_s() -> None:
    client = Client().flies()
    client.sets("GUID_TIMEOUT", 0.0)
    for _ in range(60):
        client.velocity(frame=8, mask=0x05C7)
        client.waits(0.05)
    assert client.speed() > 0.7


@pytest.mark.parametrize("mask", [0x05CF, 0x05D7, 0x05E7])
def test_px4_ignores_all_of_a_velocity_with_one_ignored_axis(mask: int) -> None:
    client = settled("px4")
    for _ in range(30):
        client.velocity(frame=8, mask=0x05C7, vx=0.0)
        client.waits(0.05)
    client.receives_texts().result(176, 1, 6)
    assert any("invalid" in text for text in texts(client.velocity(frame=8, mask=mask)))


# Messages received


@pytest.mark.parametrize(("frame", "taken"), [(1, True), (20, True), (4, False), (21, False)])
def test_px4_accepts_odometry_in_two_frames(frame: int, taken: bool) -> None:
    client = Client("px4")
    client.waits(5)
    for name, value in ((b"EKF2_OF_CTRL", 0), (b"EKF2_EV_CTRL", 5)):
        client.sends(mavlink.MAVLink_param_set_message(1, 1, name, as_float("<i", value), 6))
    level, zeros = [1.0, 0.0, 0.0, 0.0], [0.0] * 21
    for _ in range(10):
        client.sends(
            mavlink.MAVLink_odometry_message(
                *(0, frame, 12, 0, 0, 0, level, 0, 0, 0, 0, 0, 0, zeros, zeros, 0)
            )
        )
        client.waits(0.05)
    flags = requested(client, mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags
    assert bool(flags & mavlink.ESTIMATOR_POS_HORIZ_REL) is taken


def test_px4_echoes_ranges_unchanged_except_for_the_time() -> None:
    client = Client("px4")
    client.waits(2)
    client.sends(mavlink.MAVLink_distance_sensor_message(77, 2, 500, 150, 2, 9, 25, 4))
    echo = requested(client, mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR)
    assert (echo.id, echo.orientation, echo.current_distance, echo.covariance) == (9, 25, 150, 4)
    assert echo.time_boot_ms == pytest.approx(2000, abs=20)


# The table


def test_every_test_named_in_the_documentation_exists() -> None:
    named = set(re.findall(r"`(test_\w+)`", (ROOT / "docs/autopilot.md").read_text()))
    files = (ROOT / "tests").rglob("test_*.py")
    defined = set(re.findall(r"def (test_\w+)", "".join(file.read_text() for file in files)))
    assert named
    assert named - defined == set()
