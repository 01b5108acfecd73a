"""The emulated autopilot answers as PX4's source says it does."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.px4 import AUTO_LAND, AUTO_LOITER, AUTO_TAKEOFF, OFFBOARD, POSCTL
from tests.unit.autopilot_client import (
    ACCEPTED,
    FAILED,
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
    """Armed, streaming, and climbed to about a metre by setpoint."""
    armed(client)
    stream(client, 1.2)
    assert client.result(176, 1, 6) == ACCEPTED
    stream(client, 3.0, vz=-0.5)
    return client


def stream(client: Client, seconds: float, **velocity: float) -> None:
    for _ in range(round(seconds / 0.05)):
        client.velocity(frame=8, mask=VELOCITY, **{"vx": 0.0, **velocity})
        client.waits(0.05)


def test_position_and_attitude_stream_unasked(client: Client) -> None:
    client.waits(5)
    client.sends(ORIGIN)
    heard = kinds(client.waits(1))
    assert heard.count("ATTITUDE") == 100
    assert heard.count("LOCAL_POSITION_NED") == pytest.approx(30, abs=4)


def test_it_says_that_it_is_px4(client: Client) -> None:
    beat = next(m for m in client.waits(1) if m.get_type() == "HEARTBEAT")
    assert (beat.autopilot, beat.custom_mode) == (12, AUTO_LOITER)
    version = next(m for m in client.commands(512, 148) if m.get_type() == "AUTOPILOT_VERSION")
    assert version.capabilities & 16
    assert not version.capabilities & 131072


def test_offboard_needs_a_stream_of_setpoints(client: Client) -> None:
    armed(client)
    assert client.result(176, 1, 6) == REJECTED
    stream(client, 1.2)
    assert client.result(176, 1, 6) == ACCEPTED
    assert client.autopilot.mode == OFFBOARD


def test_refusals_are_temporary(client: Client) -> None:
    assert client.result(400, 1) == REJECTED
    assert client.result(400, 1, 2989) == REJECTED
    assert client.result(176, 1, 42) == REJECTED
    assert client.result(31999) == UNSUPPORTED
    assert client.result(512, 4242) == FAILED


def test_a_climbing_setpoint_lifts_it_off(client: Client) -> None:
    offboard(client)
    assert -client.autopilot.truth.position_ned_m[2] > 0.8


def test_disarming_in_the_air_is_rejected(client: Client) -> None:
    offboard(client)
    assert client.result(400, 0) == REJECTED


@pytest.mark.parametrize(
    ("frame", "flies"), [(1, True), (8, True), (7, False), (9, False), (12, False)]
)
def test_frames(client: Client, frame: int, flies: bool) -> None:
    offboard(client)
    for _ in range(15):
        heard = client.velocity(frame=frame, mask=VELOCITY)
        client.waits(0.05)
    assert (client.speed() > 0.5) == flies
    texts = [m.text for m in heard if m.get_type() == "STATUSTEXT"]
    assert any("unsupported" in text for text in texts) != flies


def test_a_setpoint_that_asks_for_nothing_is_told_invalid(client: Client) -> None:
    offboard(client)
    heard = client.velocity(frame=1, mask=0x0DFF)
    texts = [m.text for m in heard if m.get_type() == "STATUSTEXT"]
    assert any("invalid" in text for text in texts)


def test_setpoint_loss_leaves_offboard_for_position_mode(client: Client) -> None:
    offboard(client)
    client.waits(0.9)
    assert client.autopilot.mode == OFFBOARD
    client.waits(0.3)
    assert client.autopilot.mode == POSCTL


def test_setpoint_loss_can_be_set_to_land_and_to_come_later(client: Client) -> None:
    offboard(client)
    client.sets("COM_OBL_RC_ACT", as_float("<i", 4), mavlink.MAV_PARAM_TYPE_INT32)
    client.sets("COM_OF_LOSS_T", 2.0)
    client.waits(1.8)
    assert client.autopilot.mode == OFFBOARD
    client.waits(0.4)
    assert client.autopilot.mode == AUTO_LAND


def test_velocities_are_cut_to_what_is_set(client: Client) -> None:
    offboard(client)
    client.sets("MPC_XY_VEL_MAX", 0.5)
    client.sets("MPC_Z_VEL_MAX_UP", 0.25)
    stream(client, 3.0, vx=3.0, vz=-3.0)
    assert client.speed() == pytest.approx(0.5, abs=0.1)
    assert client.autopilot.truth.velocity_ned_m_s[2] == pytest.approx(-0.25, abs=0.05)


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
    client.waits(8)
    beat = [m for m in client.waits(1) if m.get_type() == "HEARTBEAT"][-1]
    assert not beat.base_mode & 128
