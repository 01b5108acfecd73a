"""Tests of the vehicle's state, odometry and texts, and of the heartbeats and setpoints sent."""

import itertools
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.core.messages import Command, CommandKind, LandedState, Setpoint
from companion.link.link import Link
from companion.link.transports.transport import Message, pipe_pair
from sitl.autopilot.core import Autopilot
from tests.unit.link.scripted_vehicle import (
    TICK_S,
    Vehicle,
    attitude,
    heartbeat,
    position,
    px4_heartbeat,
    px4_parameter,
    ticks_for,
)
from tests.unit.sitl.autopilot.client import START


def test_a_heartbeat_connects_and_a_timeout_disconnects(vehicle: Vehicle) -> None:
    assert not vehicle.sends().vehicle.connected
    state = vehicle.sends(heartbeat(4, armed=True)).vehicle
    assert (state.connected, state.mode, state.in_offboard_mode, state.armed) == (
        *(True, "GUIDED", True, True),
    )
    vehicle.now_s += 3.5
    state = vehicle.sends().vehicle
    assert not state.connected
    assert state.silent_s == pytest.approx(3.5)


def test_an_unknown_autopilot_is_not_connected(vehicle: Vehicle) -> None:
    stranger = mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 3, 3)
    assert not vehicle.sends(stranger).vehicle.connected


def test_link_sends_one_heartbeat_per_second_as_onboard_controller(vehicle: Vehicle) -> None:
    beats = [m for _ in range(60) for m in vehicle.tick() if m.get_type() == "HEARTBEAT"]
    assert len(beats) == 3
    assert (beats[0].type, beats[0].autopilot, beats[0].get_srcComponent()) == (18, 8, 191)


def test_odometry_is_extrapolated_to_the_present(vehicle: Vehicle) -> None:
    vehicle.now_s = 1.0
    vehicle.sends(heartbeat(), attitude(1000, 0.6))
    vehicle.now_s = 1.05
    odometry = vehicle.sends(position(1020, 3.0), attitude(1040, 0.7)).odometry
    assert odometry is not None
    assert odometry.position_ned_m == pytest.approx((3.003, 2.006, -0.991))
    assert odometry.yaw_rad == pytest.approx(0.6 + 0.2 * 0.05)


def test_odometry_is_marked_if_it_follows_the_pose_that_the_link_sends() -> None:
    for send_pose in (False, True):
        vehicle = Vehicle(LinkConfig(send_pose=send_pose))
        vehicle.sends(heartbeat(), position(1000), attitude(1000))
        odometry = vehicle.sends(position(1050), attitude(1050)).odometry
        assert odometry is not None
        assert odometry.follows_us is send_pose


def test_a_position_without_a_recent_attitude_gives_no_odometry(vehicle: Vehicle) -> None:
    assert vehicle.sends(heartbeat(), position(100)).odometry is None
    vehicle.sends(attitude(100))
    vehicle.now_s += 0.5
    assert vehicle.sends(position(600)).odometry is None


def test_late_and_repeated_messages_give_no_odometry(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat(), attitude(200), position(200))
    assert vehicle.sends(attitude(150), position(150)).odometry is None
    assert vehicle.sends(attitude(200), position(200)).odometry is None


@pytest.mark.parametrize(
    "broken",
    [attitude(1040, math.nan), position(1040, math.nan), position(1040, math.inf)],
    ids=["heading", "position", "infinite"],
)
def test_a_message_that_is_not_a_number_is_as_if_not_sent(broken: Message) -> None:
    """PX4 sends NaN for what its estimator does not know; one such message must not last."""
    vehicle = Vehicle()
    vehicle.now_s = 1.0
    vehicle.sends(heartbeat(), attitude(1000), position(1000))
    vehicle.sends(broken)
    vehicle.now_s = 1.1
    odometry = vehicle.sends(attitude(1080), position(1080), attitude(1100)).odometry
    assert odometry is not None
    values = (*odometry.position_ned_m, odometry.yaw_rad, odometry.pulled_rad)
    assert all(map(math.isfinite, values))


def test_a_heartbeat_of_a_ground_station_with_the_ids_of_the_autopilot_changes_no_mode(
    vehicle: Vehicle,
) -> None:
    vehicle.sends(heartbeat(4, armed=True))
    station = mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
    )
    state = vehicle.sends(station).vehicle
    assert (state.mode, state.armed, state.left_offboard) == ("GUIDED", True, False)


def test_a_pause_before_reading_drops_one_odometry(vehicle: Vehicle) -> None:
    """Messages received during the pause are newer than the last reading of our clock."""
    vehicle.sends(heartbeat())
    for tick in range(1, 40):
        sent_s = 0.05 * tick + (0.6 if tick >= 20 else 0.0)
        vehicle.now_s = sent_s if tick != 20 else sent_s - 0.6
        messages = attitude(round(1000 * sent_s)), position(round(1000 * sent_s), 0.1 * sent_s)
        odometry = vehicle.sends(*messages).odometry
        if tick != 20:
            assert odometry is not None
            assert odometry.position_ned_m[0] == pytest.approx(0.1 * vehicle.now_s, abs=0.01)


def test_messages_of_other_vehicles_are_ignored(vehicle: Vehicle) -> None:
    from companion.link.transports.transport import make_codec  # noqa: PLC0415 - only here

    stranger = heartbeat(4).pack(make_codec(2, 1))
    vehicle.transport._outbox.append(stranger)  # type: ignore[attr-defined]
    assert not vehicle.link.poll(0.0).vehicle.connected


def test_a_setpoint_is_a_body_velocity_with_yaw_rate(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat(4, armed=True))
    sent = vehicle.tick(Setpoint(0.5, -0.25, 0.125, 0.75))
    (target,) = [m for m in sent if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    assert (target.coordinate_frame, target.type_mask) == (8, 0x05C7)
    assert (target.vx, target.vy, target.vz, target.yaw_rate) == (0.5, -0.25, 0.125, 0.75)


def test_chunks_of_a_long_text_are_joined(vehicle: Vehicle) -> None:
    chunks = [
        mavlink.MAVLink_statustext_message(6, b"a" * 50, 7, 0),
        mavlink.MAVLink_statustext_message(6, b"b", 7, 1),
    ]
    assert vehicle.sends(heartbeat(), *chunks).texts == ("a" * 50 + "b",)


@pytest.mark.parametrize(("value", "state"), [(1, LandedState.ON_GROUND), (2, LandedState.IN_AIR)])
def test_landed_state_is_decoded(vehicle: Vehicle, value: int, state: LandedState) -> None:
    message = mavlink.MAVLink_extended_sys_state_message(0, value)
    assert vehicle.sends(heartbeat(), message).vehicle.landed_state is state


def test_one_wrong_report_of_the_battery_does_not_count(vehicle: Vehicle) -> None:
    def battery(percent: int) -> float | None:
        status = mavlink.MAVLink_sys_status_message(*(0,) * 5, -1, percent, *(0,) * 6)
        return vehicle.sends(status).vehicle.battery

    vehicle.sends(heartbeat())
    assert [battery(percent) for percent in (60, 0, 0, 59)] == [0.6] * 3 + [0.59]
    assert battery(-1) is None
    assert [battery(percent) for percent in (10, 10, 10)][-1] == 0.1


def test_silence_is_infinite_before_the_first_message(vehicle: Vehicle) -> None:
    assert math.isinf(vehicle.sends().vehicle.silent_s)


def test_only_a_heartbeat_makes_the_mode_recent(vehicle: Vehicle) -> None:
    assert vehicle.sends(heartbeat(4)).vehicle.is_mode_recent
    vehicle.now_s = 3.0
    state = vehicle.sends(attitude(1000)).vehicle
    assert (state.is_silent, state.is_mode_recent) == (False, False)
    assert vehicle.sends(heartbeat(5)).vehicle.is_mode_recent


def test_a_brief_mode_change_between_two_polls_is_detected(vehicle: Vehicle) -> None:
    assert not vehicle.sends(heartbeat(0), heartbeat(4)).vehicle.left_offboard
    state = vehicle.sends(heartbeat(5), heartbeat(4)).vehicle
    assert (state.in_offboard_mode, state.left_offboard) == (True, True)
    assert not vehicle.sends(heartbeat(4)).vehicle.left_offboard


def ground_beats(messages: list[Any]) -> list[Any]:
    return [m for m in messages if m.get_type() == "HEARTBEAT" and m.type == mavlink.MAV_TYPE_GCS]


@pytest.mark.parametrize(("dll_act", "beats"), [(0, 5), (2, 0), (None, 0)])
def test_ground_station_heartbeats_are_sent_only_if_px4_has_no_data_link_loss_action(
    dll_act: int | None, beats: int
) -> None:
    """The heartbeats would mask the loss of a real ground station on another link."""
    vehicle = Vehicle()
    vehicle.sends(px4_heartbeat())
    if dll_act is not None:
        vehicle.sends(px4_parameter(b"NAV_DLL_ACT", dll_act))
    received = ticks_for(vehicle, 5)
    from_ground = ground_beats(received)
    assert len(from_ground) == pytest.approx(beats, abs=1)
    assert {m.get_srcComponent() for m in from_ground} <= {190}
    own = [m for m in received if m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 191]
    assert len(own) == 5
    assert all(m.type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER for m in own)


def test_each_component_numbers_its_messages_without_gaps() -> None:
    vehicle = Vehicle()
    vehicle.sends(px4_heartbeat(), px4_parameter(b"NAV_DLL_ACT", 0))
    received = ticks_for(vehicle, 5)
    for component in (190, 191):
        numbers = [m.get_seq() for m in received if m.get_srcComponent() == component]
        steps = {(b - a) % 256 for a, b in itertools.pairwise(numbers)}
        assert steps == {1}


def test_ardupilot_receives_no_ground_station_heartbeats(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat())
    assert ground_beats(ticks_for(vehicle, 3)) == []


def test_texts_of_px4_are_received_over_a_complete_link() -> None:
    """The emulated PX4 sends texts only to a ground station."""
    vehicle_end, companion_end = pipe_pair()
    link, px4 = Link(companion_end, LinkConfig()), Autopilot(1, START, firmware="px4")
    texts: list[str] = []
    for tick in range(200):
        texts += link.poll(tick * TICK_S).texts
        link.send(tick * TICK_S, None, Command(CommandKind.ARM) if tick > 100 else None)
        for message in vehicle_end.receive():
            px4.receive(message)
        for _ in range(5):
            px4.step()
        for message in px4.take_outbox():
            vehicle_end.send(message)
        if tick == 50:
            px4.refuse_arming(refuse=True)
    assert "Arming denied: Resolve system health failures first" in texts


@pytest.mark.parametrize("text_id", [0, 7])
def test_chunks_are_joined_with_and_without_an_id(text_id: int) -> None:
    vehicle = Vehicle()
    vehicle.sends(px4_heartbeat())
    chunks = [
        mavlink.MAVLink_statustext_message(6, chunk, text_id, number)
        for number, chunk in enumerate((b"a" * 50, b"b\t"))
    ]
    assert vehicle.sends(*chunks).texts == ("a" * 50 + "b",)


def test_a_text_of_exactly_one_chunk_is_complete_after_a_timeout() -> None:
    vehicle = Vehicle()
    vehicle.sends(px4_heartbeat())
    assert vehicle.sends(mavlink.MAVLink_statustext_message(6, b"a" * 50, 7, 0)).texts == ()
    vehicle.now_s += 0.6
    assert vehicle.sends().texts == ("a" * 50,)
    vehicle.sends(mavlink.MAVLink_statustext_message(6, b"b" * 50, 8, 0))
    following = mavlink.MAVLink_statustext_message(6, b"c\t", 9, 0)
    assert vehicle.sends(following).texts == ("b" * 50, "c")
