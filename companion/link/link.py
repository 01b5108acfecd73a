"""Converts MAVLink messages into vehicle state and odometry, and sends setpoints and commands.

    HEARTBEAT ─► firmware, mode, armed            COMMAND_ACK, STATUSTEXT ─► refusals
    LOCAL_POSITION_NED + ATTITUDE ─► odometry    EKF_STATUS_REPORT ─► estimate ready

`send` sends the heartbeats, from the control loop: if the loop hangs, the heartbeats stop.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.core.messages import Command, LandedState, Odometry, Pose, Setpoint, VehicleState
from companion.core.values import value
from companion.link.battery import Battery
from companion.link.firmware import Fence, Firmware, Parameter, firmware_of
from companion.link.ground_station import GroundStation
from companion.link.odometry import ATTITUDE_HZ, POSITION_HZ, OdometryReader
from companion.link.origin import Origin
from companion.link.parameters import ReadParameters
from companion.link.pilot import Pilot
from companion.link.pose_report import PoseReport
from companion.link.pose_source import PoseSource
from companion.link.requests import CommandSender, Stream
from companion.link.senders import Senders
from companion.link.texts import StatusTexts
from companion.link.transports.transport import Message, Transport

CONNECTED_S = 3.0
"""A vehicle is disconnected after this long without any message, s. Chosen."""
HEARTBEAT_PERIOD_S = 1.0
"""Period of the companion's heartbeats, s. Chosen."""
REQUEST_PERIOD_S = 1.0
"""Period of the requests for origin and parameters, s. Chosen."""
SLOW_HZ = 2.0
"""Requested rate of the status messages, Hz. Chosen."""
VELOCITY_AND_YAW_RATE = 0x05C7
"""`type_mask` of SET_POSITION_TARGET_LOCAL_NED (84): only velocity and yaw rate are used."""


@value
class Telemetry:
    """Data received from the autopilot since the last poll."""

    vehicle: VehicleState
    odometry: Odometry | None = None
    texts: tuple[str, ...] = ()


class Listener(Protocol):
    """Receiver of certain messages from the vehicle, such as a driver of its sensors."""

    @property
    def streams_hz(self) -> Mapping[int, float]:
        """Requested rate by message id, Hz; 0: accepted but not requested."""
        ...

    def receive(self, message: Message, now_s: float) -> None: ...


class Link:
    """Connection to one vehicle; time is an argument throughout.

    With `needs_pilot` the vehicle is not ready before a pilot could take it over, and with `fence`
    not before it has confirmed this fence, which is written to its parameters.
    """

    def __init__(
        self,
        transport: Transport,
        config: LinkConfig,
        listeners: Sequence[Listener] = (),
        *,
        needs_pilot: bool = False,
        fence: Fence | None = None,
    ) -> None:
        self._fence = fence
        self._listeners = listeners
        self._pilot = Pilot() if needs_pilot else None
        self._transport = transport
        self._target = (config.system_id, int(mavlink.MAV_COMP_ID_AUTOPILOT1))
        self._component_id = config.component_id
        self._senders = Senders(config)
        self._origin = Origin(config)
        self._setpoint_loss_s = config.setpoint_loss_s
        self._firmware: Firmware | None = None
        self._safety: tuple[Parameter, ...] = ()
        self._heard_s = self._mode_s = float("-inf")
        self._armed = self._left_offboard = False
        self._custom_mode = 0
        self._landed_state = LandedState.UNKNOWN
        self._battery = Battery()
        self._estimate_complaint = "no state of its estimator received"
        self._follows_us = config.send_pose
        self._odometry = OdometryReader(follows_us=self._follows_us)
        self._pose_report = PoseReport() if config.send_pose else None
        self._pose_source = PoseSource()
        self._texts = StatusTexts()
        self._ground_station = GroundStation()
        self._read = ReadParameters()
        self._commands = CommandSender()
        self._streams: dict[int, Stream] = {}
        """By message id."""
        self._parameters_set: dict[str, bool] = {}
        self._asked_s = self._heartbeat_s = float("-inf")

    @property
    def firmware(self) -> Firmware | None:
        """The vehicle's firmware; None before its first heartbeat."""
        return self._firmware

    @property
    def streams(self) -> Sequence[Stream]:
        """Streams requested from the autopilot; empty before its first heartbeat."""
        return tuple(self._streams.values())

    def poll(self, now_s: float) -> Telemetry:
        """Process all received messages."""
        odometry = None
        texts: list[str] = []
        self._left_offboard = False
        for message in self._transport.receive():
            self._senders.receive(message, now_s)
            if (message.get_srcSystem(), message.get_srcComponent()) != self._target:
                if message.get_srcSystem() == self._target[0]:
                    self._pose_source.overhear(message, now_s)
                continue
            self._heard_s = now_s
            kind = message.get_type()
            if kind == "STATUSTEXT":
                texts += self._texts.receive(message, now_s)
            elif kind in ("LOCAL_POSITION_NED", "ATTITUDE"):
                if self._odometry.has_restarted(message):
                    self._senders.note_discontinuity(now_s)
                    self._start_over()
                odometry = self._odometry.read(message, now_s) or odometry
            else:
                self._note(kind, message)
            if stream := self._streams.get(message.get_msgId()):
                stream.note(message, now_s)
            for listener in self._listeners:
                if message.get_msgId() in listener.streams_hz:
                    listener.receive(message, now_s)
        texts += self._texts.overdue(now_s)
        for text in texts:
            self._commands.explain(text)
        return Telemetry(self._vehicle(now_s), odometry, tuple(texts))

    def _start_over(self) -> None:
        """Reset after a reboot: the autopilot may have lost its parameters and its origin."""
        self._odometry.start_over()
        self._parameters_set.clear()
        self._read.forget()
        self._origin.forget()
        self._landed_state = LandedState.UNKNOWN

    def _note(self, kind: str, message: Message) -> None:
        if kind == "HEARTBEAT":
            self._firmware = self._firmware or self._meet(message)
            self._note_heartbeat(message)
        elif kind == "SYS_STATUS":
            self._battery.receive(message)
            if self._pilot is not None:
                self._pilot.receive(message)
        elif kind == "EXTENDED_SYS_STATE":
            self._landed_state = _landed_state(message.landed_state)
        elif kind == "GPS_GLOBAL_ORIGIN":
            self._origin.receive()
        elif kind == "COMMAND_ACK":
            if message.target_component in (0, self._component_id):
                self._commands.acknowledge(message)
        elif self._firmware is None:
            return
        elif message.get_msgId() == self._firmware.estimator_message:
            self._estimate_complaint = self._firmware.estimate_complaint(message)
        elif kind == "PARAM_VALUE":
            self._read.receive(message.param_id, self._firmware.parameter_value(message))
            for parameter in self._safety:
                if message.param_id == parameter.name:
                    set_ = math.isclose(message.param_value, parameter.wire_value, rel_tol=1e-5)
                    self._parameters_set[parameter.name] = set_

    def _note_heartbeat(self, heartbeat: Message) -> None:
        custom_mode, firmware = heartbeat.custom_mode, self._firmware
        if firmware is not None:
            if heartbeat.autopilot != firmware.autopilot:
                return  # from a ground station or gimbal that uses the autopilot's ids
            was_ours = firmware.is_offboard(self._custom_mode)
            self._left_offboard |= was_ours and not firmware.is_offboard(custom_mode)
        self._custom_mode, self._mode_s = custom_mode, self._heard_s
        self._armed = bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    def _meet(self, heartbeat: Message) -> Firmware | None:
        firmware = firmware_of(heartbeat.autopilot, heartbeat.type)
        if firmware is not None:
            self._safety = firmware.safety_parameters(self._setpoint_loss_s)
            if self._fence is not None:
                self._safety += firmware.fence_parameters(self._fence)
            pose_needs = firmware.pose_needs if self._pose_report is not None else {}
            self._read.want([*firmware.texts_need, *pose_needs])
            rates_hz = {
                mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: POSITION_HZ,
                mavlink.MAVLINK_MSG_ID_ATTITUDE: ATTITUDE_HZ,
                mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: SLOW_HZ,
                mavlink.MAVLINK_MSG_ID_SYS_STATUS: SLOW_HZ,
                firmware.estimator_message: SLOW_HZ,
            }
            for listener in self._listeners:
                rates_hz |= {id_: hz for id_, hz in listener.streams_hz.items() if hz > 0}
            self._streams = {id_: Stream(id_, rate_hz) for id_, rate_hz in rates_hz.items()}
        return firmware

    def _vehicle(self, now_s: float) -> VehicleState:
        age_s = now_s - self._heard_s
        firmware = self._firmware
        if firmware is None:
            return VehicleState(silent_s=age_s, unfit=self._senders.other_senders)
        waits_for = self._waits_for(now_s)
        return VehicleState(
            connected=age_s < CONNECTED_S,
            silent_s=age_s,
            unfit=self._senders.problem,
            mode=firmware.mode_name(self._custom_mode),
            mode_age_s=now_s - self._mode_s,
            in_offboard_mode=firmware.is_offboard(self._custom_mode),
            left_offboard=self._left_offboard,
            takes_off_by_setpoint=firmware.takes_off_by_setpoint,
            armed=self._armed,
            landed_state=self._landed_state,
            estimate_ready=not waits_for,
            waits_for=waits_for,
            refusal=self._commands.refusal,
            is_refused=self._commands.is_refused,
            battery=self._battery.charge,
        )

    def transmit(self, messages: Sequence[Message]) -> None:
        """Send the messages of other modules; dropped before the autopilot's first heartbeat."""
        if self._firmware is not None:
            for message in messages:
                self._transport.send(message)

    def send(
        self,
        now_s: float,
        setpoint: Setpoint | None,
        command: Command | None,
        pose: Pose | None = None,
    ) -> None:
        """Send heartbeat, requests that are due, setpoint, command and pose."""
        for message in self._due(now_s, setpoint, command):
            self._transport.send(message)
        if self._pose_report is not None and pose is not None:
            for message in self._pose_report.messages(now_s, pose, self._odometry.told):
                self._transport.send(message)

    def _due(
        self, now_s: float, setpoint: Setpoint | None, command: Command | None
    ) -> list[Message]:
        messages: list[Message] = []
        if now_s - self._heartbeat_s >= HEARTBEAT_PERIOD_S - 1e-6:
            self._heartbeat_s = now_s
            messages.append(_heartbeat(active=setpoint is not None))
            if self._may_beat_as_ground_station():
                messages.append(self._ground_station.heartbeat())
        if self._firmware is None:
            return messages
        wanted = self._firmware.command(command) if command else None
        messages += self._commands.messages(now_s, wanted, self._target)
        if setpoint is not None:
            messages.append(_velocity(int(now_s * 1000), self._target, setpoint))
        for stream in self._streams.values():
            messages += stream.requests(now_s, self._target)
        if now_s - self._asked_s >= REQUEST_PERIOD_S:
            self._asked_s = now_s
            messages += self._requests()
        return messages

    def _may_beat_as_ground_station(self) -> bool:
        needs = self._firmware.texts_need if self._firmware is not None else {}
        return bool(needs) and all(self._read.values.get(n) == v for n, v in needs.items())

    def _requests(self) -> list[Message]:
        messages: list[Message] = []
        messages += self._origin.requests(self._target)
        messages += self._read.requests(self._target)
        messages += [
            mavlink.MAVLink_param_set_message(
                *self._target, parameter.name.encode(), parameter.wire_value, parameter.kind
            )
            for parameter in self._safety
            if not self._parameters_set.get(parameter.name)
        ]
        return messages

    def _waits_for(self, now_s: float) -> str:
        """Reason why the autopilot cannot be flown yet; empty if it can."""
        return (
            self._pose_complaint(now_s)
            or self._estimate_complaint
            or self._report_complaint()
            or self._pilot_complaint()
        )

    def _report_complaint(self) -> str:
        if missing := self._odometry.missing:
            return f"it does not send {missing}"
        if self._landed_state is LandedState.UNKNOWN:
            return "it does not report whether it has landed (EXTENDED_SYS_STATE)"
        unset = [p.name for p in self._safety if not self._parameters_set.get(p.name)]
        return f"it does not confirm {', '.join(unset)}" if unset else ""

    def _pilot_complaint(self) -> str:
        if self._pilot is None or self._firmware is None:
            return ""
        return self._pilot.complaint(self._firmware, self._firmware.mode_name(self._custom_mode))

    def _pose_complaint(self, now_s: float) -> str:
        """Reason why the autopilot cannot use our pose; empty if it can or if no pose is sent."""
        if self._pose_report is None or self._firmware is None:
            return ""
        return self._pose_source.complaint(now_s, self._firmware.pose_needs, self._read.values)


def _landed_state(value: int) -> LandedState:
    try:
        return LandedState(value)
    except ValueError:
        return LandedState.UNKNOWN


def _heartbeat(*, active: bool) -> Message:
    """HEARTBEAT (0) of an onboard controller."""
    state = mavlink.MAV_STATE_ACTIVE if active else mavlink.MAV_STATE_STANDBY
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, state, 3
    )


def _velocity(time_ms: int, target: tuple[int, int], setpoint: Setpoint) -> Message:
    """SET_POSITION_TARGET_LOCAL_NED (84) in MAV_FRAME_BODY_NED, which both firmwares accept."""
    return mavlink.MAVLink_set_position_target_local_ned_message(
        time_ms % 2**32,
        *target,
        mavlink.MAV_FRAME_BODY_NED,
        VELOCITY_AND_YAW_RATE,
        *(0.0, 0.0, 0.0),
        setpoint.forward_m_s,
        setpoint.right_m_s,
        setpoint.down_m_s,
        *(0.0, 0.0, 0.0),
        0.0,
        setpoint.yaw_rate_rad_s,
    )
