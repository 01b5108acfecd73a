"""Handles MAVLink: messages in, responses out. No message raises an exception.

commands, modes, setpoints ─► commander        parameters ─► parameters
intervals, requests ─► streams of that link    poses, ranges, heartbeats ─► outside
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.commander import Commander
from sitl.autopilot.messages import Outbox
from sitl.autopilot.parts import Parts
from sitl.autopilot.streams import Message, Streams

FORCE_ARM, FORCE_DISARM = 2989, 21196
"""Parameter 2 of MAV_CMD_COMPONENT_ARM_DISARM (400)."""
MAVLINK_TO_ALL = 0
"""target_system that addresses all systems (MAVLink)."""
FTP_NAK, FTP_FILE_NOT_FOUND = 129, 10
"""Response of FILE_TRANSFER_PROTOCOL (110): the vehicle has no files."""
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
FAILED: int = mavlink.MAV_RESULT_FAILED
DENIED: int = mavlink.MAV_RESULT_DENIED
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED

DATA_STREAMS: dict[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (mavlink.MAVLINK_MSG_ID_SYS_STATUS,),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
    ),
}
"""Messages of the streams in the deprecated REQUEST_DATA_STREAM (66)."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One link: its requested streams and its queued messages."""

    streams: Streams
    outbox: Outbox


class Protocol:
    """The message handlers of one vehicle."""

    def __init__(self, system_id: int, parts: Parts, commander: Commander) -> None:
        self._system_id = system_id
        self._is = firmware = parts.firmware
        self._status = parts.status
        self._navigation = parts.navigation
        self._telemetry = parts.telemetry
        self._broadcast = parts.broadcast
        self._commander = commander
        self._parameters = parameters = parts.parameters
        self._list_channels: list[Channel] = []
        """Links that receive the list of parameters."""
        self._handlers: dict[str, Callable[[Message, Channel], object]] = {
            "COMMAND_LONG": self._command_long,
            "COMMAND_INT": self._command_int,
            "SET_MODE": lambda m, _: self._set_mode_message(m),
            "SET_POSITION_TARGET_LOCAL_NED": lambda m, _: commander.setpoint(m),
            "SET_GPS_GLOBAL_ORIGIN": lambda m, _: self._set_origin(m),
            "PARAM_SET": lambda m, c: c.outbox.extend(parameters.set(m)),
            "PARAM_REQUEST_READ": lambda m, c: c.outbox.extend(parameters.read(m)),
            "PARAM_REQUEST_LIST": lambda m, c: self._begin_list(c),
            "TIMESYNC": self._timesync,
            "REQUEST_DATA_STREAM": self._data_stream,
            "MISSION_REQUEST_LIST": self._no_mission,
            "FILE_TRANSFER_PROTOCOL": self._no_files,
        }
        self._commands: dict[int, Callable[[Sequence[float], Channel], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: lambda p, _: self._arm_or_disarm(p),
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: lambda p, _: commander.check(),
            mavlink.MAV_CMD_DO_SET_MODE: lambda p, _: self._set_mode(p),
            mavlink.MAV_CMD_NAV_TAKEOFF: lambda p, _: commander.take_off(p[6]),
            mavlink.MAV_CMD_NAV_LAND: lambda p, _: commander.enter(firmware.land_mode),
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._send_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: lambda p, c: self._send(c, _whole(p[0])),
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: lambda p, c: self._send(
                c, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
            ),
            mavlink.MAV_CMD_GET_HOME_POSITION: lambda p, c: self._send(
                c, mavlink.MAVLINK_MSG_ID_HOME_POSITION
            ),
        }

    def receive(self, message: Message, channel: Channel) -> None:
        """Handle any message; ignore it if addressed to another system or unknown."""
        if getattr(message, "target_system", MAVLINK_TO_ALL) not in (0, self._system_id):
            return
        handler = self._handlers.get(message.get_type())
        if handler is not None:
            handler(message, channel)
            return
        now_s = self._navigation.time_s
        if message.get_type() == "HEARTBEAT" and message.type == mavlink.MAV_TYPE_GCS:
            channel.outbox.ground_station_s = now_s
        if failure := self._navigation.outside.receive(message, now_s):
            self._broadcast.text(mavlink.MAV_SEVERITY_CRITICAL, failure)

    def _begin_list(self, channel: Channel) -> None:
        if not self._parameters.is_listing:
            self._list_channels = []
        if channel not in self._list_channels:
            self._list_channels.append(channel)
        self._parameters.begin_list()

    def list_parameters(self) -> None:
        """Send this step's part of a running parameter list."""
        if not self._parameters.is_listing:
            return
        message = self._parameters.due()
        for channel in self._list_channels:
            channel.outbox.extend(message)

    # Commands

    def _command_long(self, message: Message, channel: Channel) -> None:
        """COMMAND_LONG (76)."""
        numbered = (getattr(message, f"param{i}") for i in range(1, 8))
        self._command(message, tuple(numbered), channel)

    def _command_int(self, message: Message, channel: Channel) -> None:
        """COMMAND_INT (75). No command here uses a location."""
        m = message
        first_four = (m.param1, m.param2, m.param3, m.param4)
        self._command(m, (*first_four, m.x * 1e-7, m.y * 1e-7, m.z), channel)

    def _command(self, message: Message, parameters: tuple[float, ...], channel: Channel) -> None:
        command = self._commands.get(message.command, _unsupported)
        sender = message.get_srcSystem(), message.get_srcComponent()

        def ack(result: int) -> Message:
            return mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *sender)

        at_once = message.command == mavlink.MAV_CMD_DO_SET_MODE
        if at_once and self._is.acknowledges_modes_at_once:
            channel.outbox.add(ack(ACCEPTED))
        mark = channel.outbox.begin_answer()
        result = command(parameters, channel)
        channel.outbox.answer(ack(result), mark)

    def _arm_or_disarm(self, parameters: Sequence[float]) -> int:
        """MAV_CMD_COMPONENT_ARM_DISARM (400)."""
        if parameters[0] == 0:
            return self._commander.disarm(forced=parameters[1] == FORCE_DISARM)
        return self._commander.arm(forced=parameters[1] == FORCE_ARM)

    def _set_mode(self, parameters: Sequence[float]) -> int:
        """MAV_CMD_DO_SET_MODE (176)."""
        base, main, sub = (_whole(p) for p in parameters[:3])
        if not base & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return DENIED
        return self._commander.ask_for(self._is.mode_of(main, sub))

    def _set_mode_message(self, message: Message) -> None:
        """SET_MODE (11), deprecated."""
        if message.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            self._commander.ask_for(message.custom_mode)

    # Streams and requests

    def _set_interval(self, parameters: Sequence[float], channel: Channel) -> int:
        """MAV_CMD_SET_MESSAGE_INTERVAL (511)."""
        message_id, interval_us = _whole(parameters[0]), parameters[1]
        text = self._is.no_such_message(message_id)
        if text and not channel.streams.supports(message_id):
            self._broadcast.text(mavlink.MAV_SEVERITY_WARNING, text)
        is_too_fast = 0 < interval_us < self._is.min_interval_us
        if is_too_fast or not channel.streams.set_interval(message_id, interval_us):
            return self._is.interval_refused
        return ACCEPTED

    def _send(self, channel: Channel, message_id: int) -> int:
        """MAV_CMD_REQUEST_MESSAGE (512)."""
        answers = channel.streams.make(message_id)
        channel.outbox.extend(answers)
        return ACCEPTED if answers else self._is.request_refused

    def _send_interval(self, parameters: Sequence[float], channel: Channel) -> int:
        message_id = _whole(parameters[0])
        interval = channel.streams.interval_us(message_id)
        channel.outbox.add(mavlink.MAVLink_message_interval_message(message_id & 0xFFFF, interval))
        return ACCEPTED

    def _data_stream(self, message: Message, channel: Channel) -> None:
        """REQUEST_DATA_STREAM (66); stream 0 means all."""
        asked = message.req_stream_id
        interval_us = 1e6 / message.req_message_rate if message.req_message_rate else -1
        for stream, message_ids in DATA_STREAMS.items():
            if asked in (mavlink.MAV_DATA_STREAM_ALL, stream):
                for message_id in message_ids:
                    wanted = interval_us if message.start_stop else -1
                    channel.streams.set_interval(message_id, wanted)

    # Origin, time, and features that the vehicle does not have

    def _set_origin(self, message: Message) -> None:
        """SET_GPS_GLOBAL_ORIGIN (48): once, after the attitude has settled."""
        place = message.latitude, message.longitude, message.altitude
        navigation = self._navigation
        may_be_set = navigation.origin is None and navigation.estimator.has_settled
        if not may_be_set or not self._is.accepts_origin(place):
            return
        navigation.origin = place
        if self._is.origin_text:
            self._broadcast.text(mavlink.MAV_SEVERITY_INFO, self._is.origin_text)
        for report in self._telemetry.origin():
            self._broadcast.add(report)

    def _timesync(self, message: Message, channel: Channel) -> None:
        if message.tc1 == 0:
            channel.outbox.add(self.timesync(message.ts1))

    def timesync(self, asked_ns: int | None = None) -> Message:
        """TIMESYNC (111): a response, or a request of the vehicle's own."""
        now_ns = self._status.boot_us * 1000
        if asked_ns is None:
            return mavlink.MAVLink_timesync_message(0, now_ns)
        return mavlink.MAVLink_timesync_message(now_ns, asked_ns)

    def _no_mission(self, message: Message, channel: Channel) -> None:
        sender = message.get_srcSystem(), message.get_srcComponent()
        channel.outbox.add(mavlink.MAVLink_mission_count_message(*sender, 0, message.mission_type))

    def _no_files(self, message: Message, channel: Channel) -> None:
        request = bytes(message.payload)
        sequence = (int.from_bytes(request[:2], "little") + 1) & 0xFFFF
        session, asked_opcode = request[2], request[3]
        answer = sequence.to_bytes(2, "little") + bytes(
            (session, FTP_NAK, 1, asked_opcode, 0, 0, 0, 0, 0, 0, FTP_FILE_NOT_FOUND)
        )
        sender = message.get_srcSystem(), message.get_srcComponent()
        channel.outbox.add(
            mavlink.MAVLink_file_transfer_protocol_message(0, *sender, answer.ljust(251, b"\0"))
        )


def _unsupported(parameters: Sequence[float], channel: Channel) -> int:
    return UNSUPPORTED


def _whole(parameter: float) -> int:
    """An integer from a float parameter; 0 if not finite."""
    return int(parameter) if math.isfinite(parameter) else 0
