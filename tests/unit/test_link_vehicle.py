"""The companion's view of the autopilot, against a scripted vehicle."""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config import LinkConfig
from companion.link.link import Link, Telemetry
from companion.link.requests import Stream
from companion.link.transport import Message, pipe_pair
from companion.messages import Command, CommandKind, LandedState, Setpoint

TICK_S = 0.05


class Vehicle:
    """An autopilot that says what the test tells it to, and keeps what it is told."""

    def __init__(self, config: LinkConfig | None = None) -> None:
        self.transport, companion = pipe_pair()
        self.link = Link(companion, config or LinkConfig())
        self.now_s = 0.0
        self.heard: list[Message] = []
        self.heard_at: list[tuple[float, Message]] = []

    def says(self, *messages: Message) -> Telemetry:
        for message in messages:
            self.transport.send(message)
        return self.link.poll(self.now_s)

    def tick(self, setpoint: Setpoint | None = None, command: Command | None = None) -> list[Any]:
        self.link.send(self.now_s, setpoint, command)
        new: list[Any] = self.transport.receive()
        self.heard += new
        self.heard_at += [(self.now_s, message) for message in new]
        self.now_s += TICK_S
        return new


def heartbeat(mode: int = 0, *, armed: bool = False) -> Message:
    base = 81 | (128 if armed else 0)
    return mavlink.MAVLink_heartbeat_message(2, 3, base, mode, 3, 3)


def position(ms: int, north: float = 0.0) -> Message:
    return mavlink.MAVLink_local_position_ned_message(ms, north, 2, -1, 0.1, 0.2, 0.3)


def attitude(ms: int, yaw: float = 0.5) -> Message:
    return mavlink.MAVLink_attitude_message(ms, 0, 0, yaw, 0, 0, 0.2)


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle()


def test_a_heartbeat_connects_and_silence_disconnects(vehicle: Vehicle) -> None:
    assert not vehicle.says().vehicle.connected
    state = vehicle.says(heartbeat(4, armed=True)).vehicle
    assert (state.connected, state.mode, state.in_offboard_mode, state.armed) == (
        *(True, "GUIDED", True, True),
    )
    vehicle.now_s += 3.5
    state = vehicle.says().vehicle
    assert not state.connected
    assert state.silent_s == pytest.approx(3.5)


def test_an_unknown_autopilot_is_not_connected(vehicle: Vehicle) -> None:
    stranger = mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 3, 3)
    assert not vehicle.says(stranger).vehicle.connected


def test_it_beats_once_a_second_as_an_onboard_controller(vehicle: Vehicle) -> None:
    beats = [m for _ in range(60) for m in vehicle.tick() if m.get_type() == "HEARTBEAT"]
    assert len(beats) == 3
    assert (beats[0].type, beats[0].autopilot, beats[0].get_srcComponent()) == (18, 8, 191)


def test_it_asks_for_streams_origin_and_setpoint_timeout(vehicle: Vehicle) -> None:
    vehicle.says(heartbeat())
    vehicle.tick()
    asked = {int(m.param1) for m in vehicle.heard if m.get_type() == "COMMAND_LONG"}
    assert asked == {32, 30, 245, 193, 1}
    kinds = {m.get_type() for m in vehicle.heard}
    assert {"SET_GPS_GLOBAL_ORIGIN", "PARAM_SET"} <= kinds
    (timeout,) = [m for m in vehicle.heard if m.get_type() == "PARAM_SET"]
    assert (timeout.param_id, timeout.param_value) == ("GUID_TIMEOUT", 0.5)


def test_how_long_an_old_setpoint_is_flown_can_be_set() -> None:
    vehicle = Vehicle(LinkConfig(setpoint_loss_s=2.0))
    vehicle.says(mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 81, 0, 3, 3))
    vehicle.tick()
    told = {m.param_id: m.param_value for m in vehicle.heard if m.get_type() == "PARAM_SET"}
    assert told["COM_OF_LOSS_T"] == 2.0
    assert "COM_OBL_RC_ACT" in told


def test_it_asks_again_for_a_stream_that_stays_silent(vehicle: Vehicle) -> None:
    vehicle.says(heartbeat())
    for _ in range(80):
        vehicle.says(position(int(vehicle.now_s * 1000) + 1))
        vehicle.tick()
    asked = [int(m.param1) for m in vehicle.heard if m.get_type() == "COMMAND_LONG"]
    assert asked.count(30) >= 2
    assert asked.count(32) <= 1


def asked(vehicle: Vehicle, message_id: int) -> list[float]:
    """When a stream was asked for."""
    return [
        now_s
        for now_s, m in vehicle.heard_at
        if m.get_type() == "COMMAND_LONG" and m.command == 511 and m.param1 == message_id
    ]


def streams(vehicle: Vehicle, seconds: float, attitude_hz: float) -> None:
    """All streams come as they are asked for, but ATTITUDE at another rate."""
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
        vehicle.says(position(ms), *messages, *(slow if tick % 10 == 0 else ()))
        vehicle.tick()


@pytest.mark.parametrize("rate_hz", [0.0, 0.2, 1.0, 4.0, 16.0])
def test_a_stream_that_somebody_slows_is_asked_for_again_soon_and_then_more_rarely(
    vehicle: Vehicle, rate_hz: float
) -> None:
    vehicle.says(heartbeat())
    streams(vehicle, 20.0, 25.0)
    assert len(asked(vehicle, 30)) == 1
    streams(vehicle, 8.0, rate_hz)
    assert len(asked(vehicle, 30)) >= 2
    streams(vehicle, 60.0, rate_hz)
    if rate_hz > 1.0:
        assert len(asked(vehicle, 30)) <= 6
    assert [len(asked(vehicle, other)) for other in (32, 1, 245, 193)] == [1] * 4
    told = len(asked(vehicle, 30))
    streams(vehicle, 20.0, 25.0)
    assert len(asked(vehicle, 30)) <= told + 1


@pytest.mark.parametrize("rate_hz", [20.0, 25.0, 50.0])
def test_a_stream_that_comes_about_as_asked_is_let_be(vehicle: Vehicle, rate_hz: float) -> None:
    vehicle.says(heartbeat())
    streams(vehicle, 60.0, rate_hz)
    assert len(asked(vehicle, 30)) == 1


@pytest.mark.parametrize("rate_hz", [0.4, 1.2])
def test_a_stream_of_a_low_rate_is_asked_for_again_too(vehicle: Vehicle, rate_hz: float) -> None:
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


def test_with_five_sensors_on_one_stream_each_counts_for_itself() -> None:
    stream = Stream(mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR, 20.0)
    stream.requests(0.0, (1, 1))
    requests = 0
    for tick in range(1, 200):
        for number in range(5 if tick % 4 == 0 else 0):  # 5 Hz of 20, from five sensors
            told = mavlink.MAVLink_distance_sensor_message(0, 10, 500, 100, 2, number, 0, 0)
            stream.note(told, tick * TICK_S)
        if tick % 20 == 0:
            requests += len(stream.requests(tick * TICK_S, (1, 1)))
    assert requests >= 1
    assert stream.is_slow


def test_the_estimate_is_ready_with_flags_position_and_timeout(vehicle: Vehicle) -> None:
    def report(flags: int) -> Message:
        return mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0)

    timeout = mavlink.MAVLink_param_value_message(b"GUID_TIMEOUT", 0.5, 9, 1, 65535)
    assert not vehicle.says(heartbeat(), report(167)).vehicle.estimate_ready
    assert not vehicle.says(report(895)).vehicle.estimate_ready
    assert not vehicle.says(position(1)).vehicle.estimate_ready
    assert vehicle.says(timeout).vehicle.estimate_ready
    assert not vehicle.says(report(167)).vehicle.estimate_ready


def test_odometry_is_carried_to_the_present(vehicle: Vehicle) -> None:
    vehicle.now_s = 1.0
    vehicle.says(heartbeat(), attitude(1000, 0.6))
    vehicle.now_s = 1.05
    odometry = vehicle.says(position(1020, 3.0), attitude(1040, 0.7)).odometry
    assert odometry is not None
    assert odometry.position_ned_m == pytest.approx((3.003, 2.006, -0.991))
    assert odometry.yaw_rad == pytest.approx(0.6 + 0.2 * 0.05)


def test_odometry_says_whether_it_comes_of_what_we_told() -> None:
    for send_pose in (False, True):
        vehicle = Vehicle(LinkConfig(send_pose=send_pose))
        vehicle.says(heartbeat(), position(1000), attitude(1000))
        odometry = vehicle.says(position(1050), attitude(1050)).odometry
        assert odometry is not None
        assert odometry.follows_us is send_pose


def test_a_position_without_a_fresh_attitude_is_no_odometry(vehicle: Vehicle) -> None:
    assert vehicle.says(heartbeat(), position(100)).odometry is None
    vehicle.says(attitude(100))
    vehicle.now_s += 0.5
    assert vehicle.says(position(600)).odometry is None


def test_late_and_repeated_messages_never_step_back(vehicle: Vehicle) -> None:
    vehicle.says(heartbeat(), attitude(200), position(200))
    assert vehicle.says(attitude(150), position(150)).odometry is None
    assert vehicle.says(attitude(200), position(200)).odometry is None


def test_a_pause_before_reading_costs_one_odometry(vehicle: Vehicle) -> None:
    """What came meanwhile is younger than our clock was when it was looked at."""
    vehicle.says(heartbeat())
    for tick in range(1, 40):
        told_s = 0.05 * tick + (0.6 if tick >= 20 else 0.0)
        vehicle.now_s = told_s if tick != 20 else told_s - 0.6
        said = attitude(round(1000 * told_s)), position(round(1000 * told_s), 0.1 * told_s)
        odometry = vehicle.says(*said).odometry
        if tick != 20:
            assert odometry is not None
            assert odometry.position_ned_m[0] == pytest.approx(0.1 * vehicle.now_s, abs=0.01)


def test_other_vehicles_do_not_count(vehicle: Vehicle) -> None:
    from companion.link.transport import make_codec  # noqa: PLC0415 - only here

    stranger = heartbeat(4).pack(make_codec(2, 1))
    vehicle.transport._outbox.append(stranger)  # type: ignore[attr-defined]
    assert not vehicle.link.poll(0.0).vehicle.connected


def test_a_setpoint_is_a_body_velocity_with_yaw_rate(vehicle: Vehicle) -> None:
    vehicle.says(heartbeat(4, armed=True))
    sent = vehicle.tick(Setpoint(0.5, -0.25, 0.125, 0.75))
    (target,) = [m for m in sent if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    assert (target.coordinate_frame, target.type_mask) == (8, 0x05C7)
    assert (target.vx, target.vy, target.vz, target.yaw_rate) == (0.5, -0.25, 0.125, 0.75)


def commands(vehicle: Vehicle, number: int) -> list[Message]:
    return [m for m in vehicle.heard if m.get_type() == "COMMAND_LONG" and m.command == number]


def test_a_command_is_repeated_until_it_is_wanted_no_more(vehicle: Vehicle) -> None:
    vehicle.says(heartbeat())
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
def test_commands_are_what_arducopter_takes(
    vehicle: Vehicle, command: Command, number: int, parameters: tuple[int, int]
) -> None:
    vehicle.says(heartbeat())
    vehicle.tick(command=command)
    (sent,) = commands(vehicle, number)
    assert (sent.param1, sent.param2) == parameters


def test_take_off_names_the_height(vehicle: Vehicle) -> None:
    vehicle.says(heartbeat())
    vehicle.tick(command=Command(CommandKind.TAKE_OFF, 1.5))
    (sent,) = commands(vehicle, 22)
    assert sent.param7 == 1.5


def test_a_refusal_carries_the_autopilots_reason(vehicle: Vehicle) -> None:
    vehicle.says(heartbeat())
    vehicle.tick(command=Command(CommandKind.ARM))
    ack = mavlink.MAVLink_command_ack_message(400, 4)
    text = mavlink.MAVLink_statustext_message(2, b"Arm: Need Position Estimate")
    refusal = vehicle.says(ack, text).vehicle.refusal
    assert refusal == "COMPONENT_ARM_DISARM: FAILED: Arm: Need Position Estimate"


def test_chunks_of_a_long_text_are_joined(vehicle: Vehicle) -> None:
    chunks = [
        mavlink.MAVLink_statustext_message(6, b"a" * 50, 7, 0),
        mavlink.MAVLink_statustext_message(6, b"b", 7, 1),
    ]
    assert vehicle.says(heartbeat(), *chunks).texts == ("a" * 50 + "b",)


@pytest.mark.parametrize(("value", "state"), [(1, LandedState.ON_GROUND), (2, LandedState.IN_AIR)])
def test_landed_state(vehicle: Vehicle, value: int, state: LandedState) -> None:
    message = mavlink.MAVLink_extended_sys_state_message(0, value)
    assert vehicle.says(heartbeat(), message).vehicle.landed_state is state


def test_before_anything_is_heard_the_silence_is_endless(vehicle: Vehicle) -> None:
    assert math.isinf(vehicle.says().vehicle.silent_s)
