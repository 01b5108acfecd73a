"""Tests that the emulated autopilot responds as in PX4's source."""

import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import Message, make_codec
from sitl.autopilot.px4 import AUTO_LAND, AUTO_LOITER, AUTO_TAKEOFF, OFFBOARD, POSCTL
from tests.unit.sitl.autopilot.client import (
    ACCEPTED,
    DENIED,
    ORIGIN,
    UNSUPPORTED,
    Client,
    as_float,
    kinds,
)

REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
VELOCITY = 0x05C7


@pytest.fixture
def client() -> Client:
    return Client("px4")


def armed(client: Client) -> Client:
    client.waits(5)
    client.sends(ORIGIN)
    assert client.result(400, 1) == ACCEPTED
    return client


def offboard(client: Client) -> Client:
    """Arm, stream setpoints, and climb to about a metre by setpoint."""
    armed(client)
    stream(client, 1.2)
    assert client.result(176, 1, 6) == ACCEPTED
    stream(client, 6.0, vz=-0.5)
    return client


def stream(client: Client, seconds: float, **velocity: float) -> None:
    for _ in range(round(seconds / 0.05)):
        client.velocity(frame=8, mask=VELOCITY, **{"vx": 0.0, **velocity})
        client.waits(0.05)


def test_px4_leaves_offboard_on_the_ground_too(client: Client) -> None:
    armed(client)
    stream(client, 1.2)
    assert client.result(176, 1, 6) == ACCEPTED
    client.sets("COM_OBL_RC_ACT", as_float("<i", 4), mavlink.MAV_PARAM_TYPE_INT32)
    assert client.autopilot.mode == OFFBOARD
    client.waits(1.3)
    assert client.autopilot.mode == AUTO_LAND
    assert client.autopilot.truth.position_ned_m[2] == 0


def test_px4_streams_position_and_attitude_without_a_request(client: Client) -> None:
    client.waits(5)
    client.sends(ORIGIN)
    received = kinds(client.waits(1))
    assert received.count("ATTITUDE") == 100
    assert received.count("LOCAL_POSITION_NED") == pytest.approx(30, abs=4)
    assert received.count("SYS_STATUS") == received.count("EXTENDED_SYS_STATE") == 5


def test_heartbeat_and_version_identify_px4(client: Client) -> None:
    beat = next(m for m in client.waits(1) if m.get_type() == "HEARTBEAT")
    assert (beat.autopilot, beat.custom_mode) == (12, AUTO_LOITER)
    version = next(m for m in client.commands(512, 148) if m.get_type() == "AUTOPILOT_VERSION")
    assert version.capabilities & 16
    assert not version.capabilities & 131072


def test_armed_offboard_needs_a_stream_of_setpoints(client: Client) -> None:
    armed(client)
    assert client.result(176, 1, 6) == REJECTED
    stream(client, 1.2)
    assert client.result(176, 1, 6) == ACCEPTED
    assert client.autopilot.mode == OFFBOARD


@pytest.mark.parametrize("lacks", ["position", "setpoints"])
def test_disarmed_px4_accepts_offboard_and_refuses_only_to_arm(client: Client, lacks: str) -> None:
    client.waits(5)
    if lacks == "position":
        set_integer(client, "EKF2_OF_CTRL", 0)
        stream(client, 1.2)
    assert client.result(176, 1, 6) == ACCEPTED
    assert client.autopilot.mode == OFFBOARD
    assert client.result(400, 1) == REJECTED


def set_integer(client: Client, name: str, value: int) -> None:
    client.sets(name, as_float("<i", value), mavlink.MAV_PARAM_TYPE_INT32)


def results(client: Client, command: int, *parameters: float) -> list[int]:
    acks = [m for m in client.commands(command, *parameters) if m.get_type() == "COMMAND_ACK"]
    return [ack.result for ack in acks]


def test_px4_acknowledges_a_mode_at_reception_and_at_decision(client: Client) -> None:
    armed(client)
    assert results(client, 176, 1, 6) == [ACCEPTED, REJECTED]
    assert results(client, 176, 1, 4, 6) == [ACCEPTED, ACCEPTED]
    assert results(client, 400, 1) == [ACCEPTED]


def flags(client: Client) -> int:
    reported = [m for m in client.commands(512, 230) if m.get_type() == "ESTIMATOR_STATUS"]
    flags: int = reported[0].flags
    return flags


def level(estimator_type: int) -> Message:
    return mavlink.MAVLink_odometry_message(
        *(0, 1, 12, 0, 0, 0, [1.0, 0.0, 0.0, 0.0], 0, 0, 0, 0, 0, 0),
        *([0.0] * 21, [0.0] * 21, 0, estimator_type),
    )


def by_vision(client: Client) -> Client:
    set_integer(client, "EKF2_OF_CTRL", 0)
    set_integer(client, "EKF2_EV_CTRL", 5)
    client.waits(5)
    return client


def test_px4_sets_const_pos_mode_at_rest(client: Client) -> None:
    by_vision(client)
    assert flags(client) == 229
    client.sends(level(mavlink.MAV_ESTIMATOR_TYPE_VIO))
    client.waits(0.1)
    assert flags(client) == 495
    client.sends(ORIGIN)
    assert flags(client) == 511


def test_px4_clears_const_pos_mode_in_flight(client: Client) -> None:
    offboard(client)
    assert flags(client) == 367 | mavlink.ESTIMATOR_POS_HORIZ_ABS


def test_px4_ignores_vision_speed_without_a_pose(client: Client) -> None:
    by_vision(client)
    client.sends(mavlink.MAVLink_vision_speed_estimate_message(0, 0, 0, 0))
    client.waits(0.1)
    assert flags(client) == 229


@pytest.mark.parametrize(
    ("estimator_type", "is_taken"), [(0, True), (2, True), (3, True), (6, False), (7, False)]
)
def test_px4_refuses_odometry_of_unsupported_estimator_types(
    client: Client, estimator_type: int, is_taken: bool
) -> None:
    by_vision(client).receives_texts()
    received = texts(client.sends(level(estimator_type)))
    client.waits(0.1)
    assert (flags(client) == 495) == is_taken
    refused = f"ODOMETRY: estimator_type {estimator_type} unsupported\t"
    assert received == ([] if is_taken else [refused])


def texts(received: list[Any]) -> list[str]:
    return [m.text for m in received if m.get_type() == "STATUSTEXT"]


def test_px4_sends_texts_only_to_a_link_with_a_ground_station(client: Client) -> None:
    assert texts(client.commands(400, 1)) == []
    client.receives_texts().waits(2.4)
    assert texts(client.commands(400, 1))[0].startswith("Arming denied")
    client.waits(0.2)
    assert texts(client.commands(400, 1)) == []


def test_each_link_has_its_own_ground_station() -> None:
    autopilot = Client("px4", links=2).autopilot
    beat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3)
    autopilot.receive(beat, 1)
    arm = mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    arm.pack(make_codec(1, 191))
    autopilot.receive(arm, 0)
    assert [texts(autopilot.take_outbox(link)) != [] for link in (0, 1)] == [False, True]


def test_every_px4_text_has_an_id_and_no_end_mark(client: Client) -> None:
    client.receives_texts()
    received = [m for m in client.commands(400, 1) if m.get_type() == "STATUSTEXT"]
    assert [(m.id, m.chunk_seq) for m in received] == [(0, 0), (0, 1), (1, 0)]
    assert [m.text.endswith("\t") for m in received] == [False, True, True]


def test_px4_refusals_are_temporarily_rejected(client: Client) -> None:
    assert client.result(400, 1) == REJECTED
    assert client.result(400, 1, 2989) == REJECTED
    assert client.result(176, 1, 42) == REJECTED
    assert client.result(31999) == UNSUPPORTED
    assert client.result(512, 4242) == DENIED


def test_px4_lifts_off_at_a_climbing_setpoint(client: Client) -> None:
    offboard(client)
    assert -client.autopilot.truth.position_ned_m[2] > 0.8


def test_disarming_in_the_air_is_rejected(client: Client) -> None:
    offboard(client)
    assert client.result(400, 0) == REJECTED


@pytest.mark.parametrize(
    ("frame", "flies"), [(1, True), (8, True), (7, False), (9, False), (12, False)]
)
def test_px4_flies_setpoints_only_in_frames_1_and_8(
    client: Client, frame: int, flies: bool
) -> None:
    offboard(client)
    client.receives_texts()
    for _ in range(30):
        received = client.velocity(frame=frame, mask=VELOCITY)
        client.waits(0.05)
    assert (client.speed() > 0.5) == flies
    texts = [m.text for m in received if m.get_type() == "STATUSTEXT"]
    assert any("unsupported" in text for text in texts) != flies


def test_a_setpoint_without_content_is_reported_as_invalid(client: Client) -> None:
    offboard(client).receives_texts()
    received = client.velocity(frame=1, mask=0x0DFF)
    texts = [m.text for m in received if m.get_type() == "STATUSTEXT"]
    assert any("invalid" in text for text in texts)


def test_setpoint_loss_leaves_offboard_for_position_mode(client: Client) -> None:
    offboard(client)
    client.waits(0.9)
    assert client.autopilot.mode == OFFBOARD
    client.waits(0.3)
    assert client.autopilot.mode == POSCTL


def test_action_and_delay_of_setpoint_loss_can_be_set(client: Client) -> None:
    offboard(client)
    client.sets("COM_OBL_RC_ACT", as_float("<i", 4), mavlink.MAV_PARAM_TYPE_INT32)
    client.sets("COM_OF_LOSS_T", 2.0)
    client.waits(1.8)
    assert client.autopilot.mode == OFFBOARD
    client.waits(0.4)
    assert client.autopilot.mode == AUTO_LAND


def test_velocities_are_limited_by_parameters(client: Client) -> None:
    offboard(client)
    client.sets("MPC_XY_VEL_MAX", 0.5)
    client.sets("MPC_Z_VEL_MAX_UP", 0.25)
    stream(client, 3.0, vx=3.0, vz=-3.0)
    assert 0.3 < client.speed() < 0.6  # reaches four fifths of a setpoint in some seconds
    assert client.autopilot.truth.velocity_ned_m_s[2] == pytest.approx(-0.25, abs=0.1)


def test_the_take_off_height_can_be_set(client: Client) -> None:
    client.sets("MIS_TAKEOFF_ALT", 1.5)
    armed(client)
    assert client.result(22, *[math.nan] * 7) == ACCEPTED
    client.waits(10)
    assert -client.autopilot.truth.position_ned_m[2] == pytest.approx(1.5, abs=0.2)


def test_the_take_off_command_climbs_and_then_holds(client: Client) -> None:
    armed(client)
    assert client.result(22, *[math.nan] * 7) == ACCEPTED
    assert client.autopilot.mode == AUTO_TAKEOFF
    client.waits(10)
    assert client.autopilot.mode == AUTO_LOITER
    assert -client.autopilot.truth.position_ned_m[2] == pytest.approx(2.5, abs=0.2)


def test_landing_disarms(client: Client) -> None:
    offboard(client)
    assert client.result(21) == ACCEPTED
    client.waits(10)  # 8 to 10 s, as measured
    beat = [m for m in client.waits(1) if m.get_type() == "HEARTBEAT"][-1]
    assert not beat.base_mode & 128


def test_the_velocity_error_is_independent_of_the_true_motion(client: Client) -> None:
    """Compares reported displacements with true ones, as measured in four real flights.

    The regression of reported on true displacement has the same scale over 0.2 s as over 20 s,
    within 0.5 %. The scale of true on reported displacement is 1 to 3 % smaller over 0.2 s.
    """
    offboard(client)
    true_m, reported_m = [], []
    for step in range(600):
        stream(client, 0.2, vx=0.8 if step // 40 % 2 else -0.8)
        north, east, _ = client.autopilot.truth.position_ned_m
        yaw_rad = client.autopilot.estimate.yaw_rad - client.autopilot.truth.yaw_rad
        true_m.append((north + 1j * east) * np.exp(1j * yaw_rad))
        north, east, _ = client.autopilot.estimate.position_ned_m
        reported_m.append(north + 1j * east)
    true, reported = np.diff(true_m), np.diff(reported_m)
    slow_true, slow_reported = (np.subtract(way[50:], way[:-50]) for way in (true_m, reported_m))
    scale = abs(np.vdot(slow_true, slow_reported)) / np.vdot(slow_true, slow_true).real
    at_once = abs(np.vdot(true, reported)) / np.vdot(true, true).real
    assert at_once == pytest.approx(scale, rel=0.01)
    assert np.vdot(reported, reported).real / abs(np.vdot(reported, true)) > 1.015 * scale
