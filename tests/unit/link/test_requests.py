"""Tests of requests for streams, of commands and their answers, and of the global origin."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.core.messages import Command, CommandKind
from companion.link.requests import Stream
from companion.link.transports.transport import Message
from tests.unit.link.scripted_vehicle import (
    TICK_S,
    Vehicle,
    attitude,
    heartbeat,
    position,
    ticks_for,
)


def test_link_requests_streams_origin_and_setpoint_timeout(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat())
    vehicle.tick()
    asked = {int(m.param1) for m in vehicle.received if m.get_type() == "COMMAND_LONG"}
    assert asked == {32, 30, 245, 193, 1, 49}
    (timeout,) = [m for m in vehicle.received if m.get_type() == "PARAM_SET"]
    assert (timeout.param_id, timeout.param_value) == ("GUID_TIMEOUT", 0.5)


def test_setpoint_timeout_is_configurable() -> None:
    vehicle = Vehicle(LinkConfig(setpoint_loss_s=2.0))
    vehicle.sends(mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 81, 0, 3, 3))
    vehicle.tick()
    parameters = {
        m.param_id: m.param_value for m in vehicle.received if m.get_type() == "PARAM_SET"
    }
    assert parameters["COM_OF_LOSS_T"] == 2.0
    assert "COM_OBL_RC_ACT" in parameters


def test_link_requests_a_missing_stream_again(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat())
    for _ in range(80):
        vehicle.sends(position(int(vehicle.now_s * 1000) + 1))
        vehicle.tick()
    asked = [int(m.param1) for m in vehicle.received if m.get_type() == "COMMAND_LONG"]
    assert asked.count(30) >= 2
    assert asked.count(32) <= 1


def asked(vehicle: Vehicle, message_id: int) -> list[float]:
    """Times of the requests for a stream, s."""
    return [
        now_s
        for now_s, m in vehicle.received_at
        if m.get_type() == "COMMAND_LONG" and m.command == 511 and m.param1 == message_id
    ]


def streams(vehicle: Vehicle, seconds: float, attitude_hz: float) -> None:
    """All streams arrive at the requested rate, except ATTITUDE."""
    slow = (
        mavlink.MAVLink_extended_sys_state_message(0, 1),
        mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, 50, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0),
    )
    due = 0.0
    for tick in range(round(seconds / TICK_S)):
        ms = round(vehicle.now_s * 1000) + 1
        due += attitude_hz * TICK_S
        messages = [attitude(ms + n) for n in range(int(due))]
        due -= int(due)
        vehicle.sends(position(ms), *messages, *(slow if tick % 10 == 0 else ()))
        vehicle.tick()


@pytest.mark.parametrize("rate_hz", [0.0, 0.2, 1.0, 4.0, 16.0])
def test_a_slowed_stream_is_requested_again_soon_and_then_less_often(
    vehicle: Vehicle, rate_hz: float
) -> None:
    vehicle.sends(heartbeat())
    streams(vehicle, 20.0, 25.0)
    assert len(asked(vehicle, 30)) == 1
    streams(vehicle, 8.0, rate_hz)
    assert len(asked(vehicle, 30)) >= 2
    streams(vehicle, 60.0, rate_hz)
    if rate_hz > 1.0:
        assert len(asked(vehicle, 30)) <= 6
    assert [len(asked(vehicle, other)) for other in (32, 1, 245, 193)] == [1] * 4
    requests = len(asked(vehicle, 30))
    streams(vehicle, 20.0, 25.0)
    assert len(asked(vehicle, 30)) <= requests + 1


@pytest.mark.parametrize("rate_hz", [20.0, 25.0, 50.0])
def test_a_stream_at_the_requested_rate_is_not_requested_again(
    vehicle: Vehicle, rate_hz: float
) -> None:
    vehicle.sends(heartbeat())
    streams(vehicle, 60.0, rate_hz)
    assert len(asked(vehicle, 30)) == 1


@pytest.mark.parametrize("rate_hz", [0.4, 1.2])
def test_a_low_rate_stream_that_is_too_slow_is_requested_again(
    vehicle: Vehicle, rate_hz: float
) -> None:
    stream = Stream(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 2.0)
    status = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, 50, 0, 0, 0, 0, 0, 0)
    stream.requests(0.0, (1, 1))
    requests, due = 0, 0.0
    for second in range(1, 31):
        due += rate_hz
        for _ in range(int(due)):
            stream.note(status, float(second))
        due -= int(due)
        requests += len(stream.requests(float(second), (1, 1)))
    assert 2 <= requests <= 20


def test_rate_of_a_stream_with_five_sensors_is_measured_per_sensor() -> None:
    stream = Stream(mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR, 20.0)
    stream.requests(0.0, (1, 1))
    requests = 0
    for tick in range(1, 200):
        for number in range(5 if tick % 4 == 0 else 0):  # 5 Hz of 20, from five sensors
            message = mavlink.MAVLink_distance_sensor_message(0, 10, 500, 100, 2, number, 0, 0)
            stream.note(message, tick * TICK_S)
        if tick % 20 == 0:
            requests += len(stream.requests(tick * TICK_S, (1, 1)))
    assert requests >= 1
    assert stream.is_slow


# Commands, and the answers to them


def commands(vehicle: Vehicle, number: int) -> list[Message]:
    return [m for m in vehicle.received if m.get_type() == "COMMAND_LONG" and m.command == number]


def test_a_command_is_repeated_while_it_is_requested(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat())
    for _ in range(25):
        vehicle.tick(command=Command(CommandKind.ARM))
    sent = commands(vehicle, 400)
    assert [m.confirmation for m in sent] == [0, 1, 2]
    for _ in range(25):
        vehicle.tick()
    assert len(commands(vehicle, 400)) == 3


@pytest.mark.parametrize(
    ("command", "number", "parameters"),
    [
        (Command(CommandKind.OFFBOARD_MODE), 176, (1, 4)),
        (Command(CommandKind.ARM), 400, (1, 0)),
        (Command(CommandKind.DISARM), 400, (0, 0)),
        (Command(CommandKind.LAND), 176, (1, 9)),
    ],
)
def test_commands_have_the_parameters_that_arducopter_expects(
    vehicle: Vehicle, command: Command, number: int, parameters: tuple[int, int]
) -> None:
    vehicle.sends(heartbeat())
    vehicle.tick(command=command)
    (sent,) = commands(vehicle, number)
    assert (sent.param1, sent.param2) == parameters


def test_take_off_command_contains_the_height(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat())
    vehicle.tick(command=Command(CommandKind.TAKE_OFF, 1.5))
    (sent,) = commands(vehicle, 22)
    assert sent.param7 == 1.5


def test_a_refusal_contains_the_autopilots_reason(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat())
    vehicle.tick(command=Command(CommandKind.ARM))
    ack = mavlink.MAVLink_command_ack_message(400, 4)
    text = mavlink.MAVLink_statustext_message(2, b"Arm: Need Position Estimate")
    refusal = vehicle.sends(ack, text).vehicle.refusal
    assert refusal == "COMPONENT_ARM_DISARM: FAILED: Arm: Need Position Estimate"


def ack(command: int, result: int, to_component: int = 0) -> Message:
    return mavlink.MAVLink_command_ack_message(command, result, 0, 0, 1, to_component)


@pytest.mark.parametrize(
    ("results", "refused"), [((), False), ((1,), True), ((0,), False), ((0, 1), False)]
)
def test_a_command_is_refused_if_all_acknowledgements_refuse_it(
    vehicle: Vehicle, results: tuple[int, ...], refused: bool
) -> None:
    vehicle.sends(heartbeat(4))
    vehicle.tick(command=Command(CommandKind.ARM))
    state = vehicle.sends(*(ack(400, result) for result in results)).vehicle
    assert state.is_refused == refused


def test_an_acknowledgement_for_another_component_is_ignored(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat(4))
    vehicle.tick(command=Command(CommandKind.ARM))
    assert not vehicle.sends(ack(400, 4, to_component=190)).vehicle.is_refused
    assert vehicle.sends(ack(400, 4, to_component=191)).vehicle.is_refused


@pytest.mark.parametrize("results", [(0,), (5,), (0, 1), (1, 0)])
def test_take_off_is_repeated_until_it_is_accepted(
    vehicle: Vehicle, results: tuple[int, ...]
) -> None:
    vehicle.sends(heartbeat(4, armed=True))
    take_off = Command(CommandKind.TAKE_OFF, 1.2)
    for _ in range(15):
        vehicle.tick(command=take_off)
    assert len(commands(vehicle, 22)) == 2
    vehicle.sends(*(ack(22, result) for result in results))
    vehicle.tick()
    for _ in range(200):
        vehicle.tick(command=take_off)
    assert len(commands(vehicle, 22)) == 2


def test_an_accepted_mode_is_requested_until_a_heartbeat_reports_it(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat())
    vehicle.tick(command=Command(CommandKind.OFFBOARD_MODE))
    vehicle.sends(ack(176, 0))
    for _ in range(15):
        vehicle.tick(command=Command(CommandKind.OFFBOARD_MODE))
    assert len(commands(vehicle, 176)) == 2


def test_the_refusal_of_one_command_is_not_reported_for_the_next(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat())
    vehicle.tick(command=Command(CommandKind.OFFBOARD_MODE))
    assert vehicle.sends(ack(176, 0), ack(176, 1)).vehicle.refusal
    vehicle.tick(command=Command(CommandKind.ARM))
    assert vehicle.sends().vehicle.refusal == ""


# Global origin


def origins(messages: list[Any]) -> int:
    return [m.get_type() for m in messages].count("SET_GPS_GLOBAL_ORIGIN")


ORIGIN = mavlink.MAVLink_gps_global_origin_message(473977000, 85456000, 488000)


def test_an_autopilot_that_has_an_origin_keeps_it(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat())
    vehicle.tick()
    vehicle.sends(ORIGIN)
    assert origins(ticks_for(vehicle, 5)) == 0


def test_an_autopilot_without_an_origin_receives_ours_until_it_reports_one(
    vehicle: Vehicle,
) -> None:
    vehicle.sends(heartbeat(), position(1))
    assert origins(ticks_for(vehicle, 5)) == 4
    vehicle.sends(ORIGIN)
    assert origins(ticks_for(vehicle, 5)) == 0


def test_a_restarted_autopilot_receives_the_origin_again(vehicle: Vehicle) -> None:
    vehicle.sends(heartbeat(), ORIGIN, attitude(60_000))
    assert origins(ticks_for(vehicle, 3)) == 0
    vehicle.sends(attitude(100))
    assert origins(ticks_for(vehicle, 5)) > 2
