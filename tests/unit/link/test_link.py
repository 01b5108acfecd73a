"""Vehicle state, odometry and requests of the link, against a scripted vehicle."""

import itertools
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.core.messages import Command, CommandKind, LandedState, Setpoint
from companion.link.link import Link, Telemetry
from companion.link.requests import Stream
from companion.link.transports.transport import Message, pipe_pair, sent_by
from sitl.autopilot.core import Autopilot
from tests.unit.sitl.autopilot.client import START, as_float

TICK_S = 0.05


class Vehicle:
    """An autopilot that sends the messages of the test and stores those it receives."""

    def __init__(self, config: LinkConfig | None = None) -> None:
        self.transport, companion = pipe_pair()
        self.link = Link(companion, config or LinkConfig())
        self.now_s = 0.0
        self.received: list[Message] = []
        self.received_at: list[tuple[float, Message]] = []

    def sends(self, *messages: Message) -> Telemetry:
        for message in messages:
            self.transport.send(message)
        return self.link.poll(self.now_s)

    def tick(self, setpoint: Setpoint | None = None, command: Command | None = None) -> list[Any]:
        self.link.send(self.now_s, setpoint, command)
        new: list[Any] = self.transport.receive()
        self.received += new
        self.received_at += [(self.now_s, message) for message in new]
        self.now_s += TICK_S
        return new


def heartbeat(mode: int = 0, *, armed: bool = False) -> Message:
    base = 81 | (128 if armed else 0)
    return mavlink.MAVLink_heartbeat_message(2, 3, base, mode, 3, 3)


def position(ms: int, north: float = 0.0) -> Message:
    return mavlink.MAVLink_local_position_ned_message(ms, north, 2, -1, 0.1, 0.2, 0.3)


def attitude(ms: int, yaw: float = 0.5) -> Message:
    return mavlink.MAVLink_attitude_message(ms, 0, 0, yaw, 0, 0, 0.2)


def landed_state(value: int) -> Message:
    return mavlink.MAVLink_extended_sys_state_message(0, value)


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle()


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


def test_estimate_is_ready_with_flags_position_timeout_and_landed_state(vehicle: Vehicle) -> None:
    def report(flags: int) -> Message:
        return mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0)

    timeout = mavlink.MAVLink_param_value_message(b"GUID_TIMEOUT", 0.5, 9, 1, 65535)
    assert not vehicle.sends(heartbeat(), report(167)).vehicle.estimate_ready
    assert not vehicle.sends(report(895)).vehicle.estimate_ready
    assert not vehicle.sends(position(1)).vehicle.estimate_ready
    state = vehicle.sends(timeout).vehicle
    assert not state.estimate_ready
    assert "whether it has landed (EXTENDED_SYS_STATE)" in state.waits_for
    assert vehicle.sends(landed_state(1)).vehicle.estimate_ready
    assert not vehicle.sends(report(167)).vehicle.estimate_ready


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


def test_silence_is_infinite_before_the_first_message(vehicle: Vehicle) -> None:
    assert math.isinf(vehicle.sends().vehicle.silent_s)


# Control of the drone, and answers to commands


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


def ticks_for(vehicle: Vehicle, seconds: float) -> list[Any]:
    return [m for _ in range(round(seconds / TICK_S)) for m in vehicle.tick()]


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


# PX4


PX4_ESTIMATE_AT_REST = 495


def px4_heartbeat() -> Message:
    return mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 81, 0, 3, 3)


def px4_parameter(name: bytes, value: int) -> Message:
    return mavlink.MAVLink_param_value_message(name, as_float("<i", value), 6, 1, 0)


def px4_estimate(flags: int) -> Message:
    return mavlink.MAVLink_estimator_status_message(0, flags, *(0.0,) * 8)


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (PX4_ESTIMATE_AT_REST, ""),
        (511, ""),
        (367, ""),
        (239, ""),
        (229, "no velocity source"),
        (128, "not settled"),
        (PX4_ESTIMATE_AT_REST & ~8, "no position"),
    ],
)
def test_px4_estimate_is_ready_at_rest_but_not_without_position_or_velocity(
    flags: int, complaint: str
) -> None:
    vehicle = Vehicle()
    timeout = mavlink.MAVLink_param_value_message(b"COM_OF_LOSS_T", 0.5, 9, 1, 0)
    action = px4_parameter(b"COM_OBL_RC_ACT", 4)
    vehicle.sends(px4_heartbeat(), position(1), landed_state(1))
    state = vehicle.sends(timeout, action, px4_estimate(flags)).vehicle
    assert state.estimate_ready == (not complaint)
    assert complaint in state.waits_for


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


# Our pose


ARDUPILOT_POSE = {"VISO_TYPE": 1, "EK3_SRC1_POSXY": 6, "EK3_SRC1_VELXY": 5, "EK3_SRC1_YAW": 6}
PX4_POSE = {"EKF2_EV_CTRL": 9, "EKF2_OF_CTRL": 1}


class PoseVehicle(Vehicle):
    """A vehicle that is ready except for its parameters on our pose."""

    def __init__(self, autopilot: str, parameters: dict[str, int]) -> None:
        super().__init__(LinkConfig(send_pose=True))
        if autopilot == "px4":
            timeout = mavlink.MAVLink_param_value_message(b"COM_OF_LOSS_T", 0.5, 9, 1, 0)
            self.sends(px4_heartbeat(), timeout, px4_parameter(b"COM_OBL_RC_ACT", 4))
            self.sends(px4_estimate(PX4_ESTIMATE_AT_REST))
            reports = [px4_parameter(name.encode(), value) for name, value in parameters.items()]
        else:
            timeout = mavlink.MAVLink_param_value_message(b"GUID_TIMEOUT", 0.5, 9, 1, 0)
            report = mavlink.MAVLink_ekf_status_report_message(895, 0, 0, 0, 0, 0)
            self.sends(heartbeat(), timeout, report)
            reports = [
                mavlink.MAVLink_param_value_message(name.encode(), value, 2, 1, 0)
                for name, value in parameters.items()
            ]
        self.sends(position(1), landed_state(1), *reports)

    @property
    def waits_for(self) -> str:
        return self.sends().vehicle.waits_for


@pytest.mark.parametrize(
    ("autopilot", "right", "name", "wrong"),
    [
        ("ardupilot", ARDUPILOT_POSE, "EK3_SRC1_YAW", 1),
        ("ardupilot", ARDUPILOT_POSE, "EK3_SRC1_VELXY", 6),
        ("ardupilot", ARDUPILOT_POSE, "EK3_SRC1_POSXY", 0),
        ("ardupilot", ARDUPILOT_POSE, "VISO_TYPE", 0),
        ("px4", PX4_POSE, "EKF2_EV_CTRL", 5),
        ("px4", PX4_POSE, "EKF2_EV_CTRL", 0),
        ("px4", PX4_POSE, "EKF2_OF_CTRL", 0),
    ],
)
def test_an_autopilot_with_wrong_parameters_for_our_pose_is_refused(
    autopilot: str, right: dict[str, int], name: str, wrong: int
) -> None:
    assert PoseVehicle(autopilot, right).waits_for == ""
    waits_for = PoseVehicle(autopilot, {**right, name: wrong}).waits_for
    assert f"{name} is {wrong}, set it to {right[name]}" in waits_for
    without = {other: value for other, value in right.items() if other != name}
    assert f"does not report {name}" in PoseVehicle(autopilot, without).waits_for


def test_pose_parameters_are_not_requested_without_send_pose() -> None:
    vehicle = Vehicle()
    vehicle.sends(heartbeat())
    assert not any(m.get_type() == "PARAM_REQUEST_READ" for m in ticks_for(vehicle, 3))


@pytest.mark.parametrize("component", [197, 25])
@pytest.mark.parametrize("kind", ["odometry", "vision"])
def test_a_second_sender_of_poses_is_refused(component: int, kind: str) -> None:
    vehicle = PoseVehicle("ardupilot", ARDUPILOT_POSE)
    message = (
        mavlink.MAVLink_vision_position_estimate_message(0, 0, 0, 0, 0, 0, 0)
        if kind == "vision"
        else mavlink.MAVLink_odometry_message(
            *(0, 20, 12, 0, 0, 0, [1, 0, 0, 0], *(0,) * 6, [0] * 21, [0] * 21, 0, 2)
        )
    )
    vehicle.sends(sent_by(message, component, 0))
    assert f"component {component} sends it a pose" in vehicle.waits_for
    vehicle.now_s += 6
    vehicle.sends(heartbeat())
    assert vehicle.waits_for == ""


def test_the_autopilots_own_odometry_does_not_count_as_a_second_sender() -> None:
    vehicle = PoseVehicle("px4", PX4_POSE)
    own = mavlink.MAVLink_odometry_message(
        *(0, 1, 12, 0, 0, 0, [1, 0, 0, 0], *(0,) * 6, [0] * 21, [0] * 21, 0, 8)
    )
    vehicle.sends(own)
    assert vehicle.waits_for == ""
