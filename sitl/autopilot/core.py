"""The emulated flight controller: MAVLink in, MAVLink out, and a vehicle that it flies.

What happens is decided here, how it is called and answered by the personality. Nothing that comes
in raises.
"""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.ardupilot import ArduPilot
from sitl.autopilot.control import Control, Manoeuvre
from sitl.autopilot.estimator import REFERENCE_NOISE, FlowEstimator, OdometryNoise
from sitl.autopilot.messages import Outgoing
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.autopilot.personality import (
    Behaviour,
    Personality,
    Refusal,
    boot_values,
    system_id,
)
from sitl.autopilot.px4 import Px4
from sitl.autopilot.streams import Message, Streams
from sitl.autopilot.telemetry import Status, Telemetry
from sitl.noise import stream
from sitl.truth import TrueState
from sitl.vehicle import STEP_S, Vehicle

PERSONALITIES: dict[str, type[ArduPilot] | type[Px4]] = {"ardupilot": ArduPilot, "px4": Px4}

HEARTBEAT_STEPS = 100
FLIGHT_BATTERY_S = 600.0
"""How long a full battery flies."""
STREAM_STEPS = 50
"""Setpoints no farther apart than this are a stream."""
LIFT_OFF_M_S = -0.1
"""A climbing setpoint of this down velocity lifts a vehicle that lifts off by setpoint."""
FORCE_ARM = 2989
NO_PARAMETERS: Mapping[str, float] = MappingProxyType({})
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
FAILED: int = mavlink.MAV_RESULT_FAILED
DENIED: int = mavlink.MAV_RESULT_DENIED
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED


def keep_nothing(name: str, value: float) -> None:
    """For a vehicle that forgets what it was set to."""


class Autopilot:
    """One vehicle with its flight controller; time passes only by `step`.

    `parameters` are set before it starts; `watch` is told those that a client sets.

    Raises:
        ParameterError: a parameter that it does not have.
    """

    def __init__(
        self,
        seed: int,
        start: TrueState,
        noise: OdometryNoise = REFERENCE_NOISE,
        *,
        personality: str = "ardupilot",
        parameters: Mapping[str, float] = NO_PARAMETERS,
        watch: ParameterWatch = keep_nothing,
    ) -> None:
        self._is: Personality = PERSONALITIES[personality]()
        self._vehicle = Vehicle(start, stream(seed, "gusts"))
        self._estimator = FlowEstimator(start, stream(seed, "flow"), noise)
        self._control = Control(self._estimator)
        values = boot_values(self._is, parameters)
        self.system_id = system_id(self._is, values)
        self._parameters = self._is.parameter_protocol(self._is.table, values, watch)
        self._outgoing = Outgoing()
        self._status = Status(self._is.boot_mode)
        self._telemetry = Telemetry(self._is, self._status, self._estimator)
        self._telemetry.truth = start
        self._streams = Streams(self._telemetry.makers(), self._is.streams_hz)
        self._setpoint_step: int | None = None

    # Time

    @property
    def time_s(self) -> float:
        return self._status.step * STEP_S

    @property
    def mode(self) -> int:
        """HEARTBEAT.custom_mode."""
        return self._status.mode

    @property
    def truth(self) -> TrueState:
        return self._vehicle.state

    def step(self) -> None:
        """10 ms of flight."""
        status = self._status
        status.step += 1
        self._expire_setpoint()
        if status.armed:
            self._fly()
        else:
            self._vehicle.rest()
        self._telemetry.truth = self._vehicle.state
        self._estimator.update(self._vehicle.state)
        status.manoeuvre = self._control.manoeuvre
        if status.step % HEARTBEAT_STEPS == 0:
            status.is_armable = not self._arming_complaint()
            self._outgoing.add(self._telemetry.heartbeat())
        self._outgoing.extend(self._streams.due(status.step))
        self._outgoing.extend(self._parameters.due())

    def take_outbox(self) -> list[Message]:
        """What has been said since the last call."""
        return self._outgoing.take()

    def _fly(self) -> None:
        was = self._control.manoeuvre
        if was is Manoeuvre.GROUND:
            self._vehicle.rest()
            return
        velocity, yaw_rate = self._control.wanted(self.time_s, on_ground=self._vehicle.on_ground)
        self._vehicle.step(
            self._estimator.to_true_frame(velocity), self._estimator.to_true_rate(yaw_rate)
        )
        self._status.battery = max(0.0, self._status.battery - STEP_S / FLIGHT_BATTERY_S)
        if self._control.manoeuvre is Manoeuvre.GROUND:
            self._disarm()
        climbed = was is Manoeuvre.CLIMB and self._control.manoeuvre is Manoeuvre.HOLD
        if climbed and self._status.mode == self._is.take_off_mode:
            self._enter(self._is.hold_mode)

    def _expire_setpoint(self) -> None:
        """The last setpoint is flown for a while; then the vehicle brakes, or changes its mode."""
        if self._setpoint_step is None or self._control.manoeuvre is not Manoeuvre.VELOCITY:
            return
        timeout_s, mode = self._is.setpoint_loss(self._parameters.values)
        if (self._status.step - self._setpoint_step) * STEP_S > timeout_s:
            self._control.hold()
            if mode is not None:
                self._enter(mode)

    # What happens to it

    def crash(self, reason: str) -> None:
        """It has hit something: motors off for good."""
        self._status.crashed = True
        self._disarm()
        self._outgoing.text(mavlink.MAV_SEVERITY_EMERGENCY, f"Crash: {reason}")

    def pilot_mode(self, custom_mode: int) -> None:
        """The pilot's mode switch."""
        self._enter(custom_mode)

    def _disarm(self) -> None:
        self._status.armed = False
        self._control.stop()

    # Messages in

    def receive(self, message: Message) -> None:
        """Anything a client may send; what is not for this vehicle or not known is ignored."""
        handlers: dict[str, Callable[[Message], object]] = {
            "COMMAND_LONG": self._command_long,
            "SET_MODE": self._set_mode_message,
            "SET_POSITION_TARGET_LOCAL_NED": self._setpoint,
            "SET_GPS_GLOBAL_ORIGIN": self._set_origin,
            "PARAM_SET": lambda m: self._outgoing.extend(self._parameters.set(m)),
            "PARAM_REQUEST_READ": lambda m: self._outgoing.extend(self._parameters.read(m)),
            "PARAM_REQUEST_LIST": lambda m: self._parameters.begin_list(),
            "TIMESYNC": self._timesync,
        }
        handler = handlers.get(message.get_type())
        if handler is not None and getattr(message, "target_system", 0) in (0, self.system_id):
            handler(message)

    def _command_long(self, message: Message) -> None:
        commands: dict[int, Callable[[Message], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_or_disarm,
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: self._check,
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LAND: lambda m: self._enter(self._is.land_mode),
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._tell_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._send_requested,
        }
        command = commands.get(message.command, lambda m: UNSUPPORTED)
        mark = self._outgoing.begin_answer()
        result = command(message)
        sender = message.get_srcSystem(), message.get_srcComponent()
        ack = mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *sender)
        self._outgoing.answer(ack, mark)

    # Modes, arming, take-off

    def _set_mode(self, message: Message) -> int:
        """MAV_CMD_DO_SET_MODE (176)."""
        base, main, sub = (_whole(p) for p in (message.param1, message.param2, message.param3))
        if not base & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return DENIED
        return self._ask_for(self._is.mode_of(main, sub))

    def _set_mode_message(self, message: Message) -> None:
        """SET_MODE (11), the old way."""
        if message.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            self._ask_for(message.custom_mode)

    def _ask_for(self, mode: int) -> int:
        if self._is.behaviour(mode) is Behaviour.OFFBOARD and not self._may_go_offboard():
            return self._is.refused
        return self._enter(mode)

    def _may_go_offboard(self) -> bool:
        if not self._is.setpoints_before_offboard:
            return True
        since = self._setpoint_step
        streaming = since is not None and self._status.step - since <= STREAM_STEPS
        return streaming and self._estimator.has_settled

    def _enter(self, mode: int) -> int:
        behaviour = self._is.behaviour(mode)
        if behaviour is None:
            if text := self._is.no_such_mode(mode):
                self._outgoing.text(mavlink.MAV_SEVERITY_WARNING, text)
            return self._is.refused
        if mode == self._status.mode:
            return ACCEPTED
        self._status.mode = mode
        self._outgoing.add(self._telemetry.heartbeat())
        if behaviour is Behaviour.LAND:
            self._control.land()
        elif behaviour is not Behaviour.TAKE_OFF:
            self._control.hold()
        return ACCEPTED

    def _arming_complaint(self) -> str:
        if self._status.crashed:
            return "Crashed: restart the simulator"
        if not self._estimator.has_settled:
            return "AHRS: not healthy"
        if self._status.origin is None:
            return "AHRS: waiting for home"
        return ""

    def _check(self, message: Message) -> int:
        if complaint := self._arming_complaint():
            self._outgoing.text(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {complaint}")
        return ACCEPTED

    def _arm_or_disarm(self, message: Message) -> int:
        if message.param1 == 0:
            if not self._vehicle.on_ground:
                return self._is.refused
            self._disarm()
            return ACCEPTED
        if complaint := self._arming_complaint():
            forced = message.param2 == FORCE_ARM
            text = "Need Position Estimate" if forced else complaint
            self._outgoing.text(mavlink.MAV_SEVERITY_CRITICAL, f"Arm: {text}")
            return self._is.refused
        self._status.armed = True
        return ACCEPTED

    def _take_off(self, message: Message) -> int:
        height_m = self._is.take_off_height_m(message.param7, self._parameters.values)
        offboard = self._is.behaviour(self._status.mode) is Behaviour.OFFBOARD
        ready = self._status.armed and self._vehicle.on_ground
        in_right_mode = self._is.take_off_mode is not None or offboard
        if not ready or not in_right_mode or not 0 < height_m < 1000:  # false for NaN too
            return FAILED if self._is.take_off_mode is None else self._is.refused
        if self._is.take_off_mode is not None:
            self._enter(self._is.take_off_mode)
        self._control.take_off(self.time_s, height_m)
        return ACCEPTED

    def _setpoint(self, message: Message) -> None:
        target = self._is.setpoint(message, self._estimator.yaw_rad, self._parameters.values)
        if isinstance(target, Refusal) and target.text:
            self._outgoing.text(mavlink.MAV_SEVERITY_ERROR, target.text)
        offboard = self._is.behaviour(self._status.mode) is Behaviour.OFFBOARD
        if isinstance(target, Refusal):
            if target.stops and offboard:
                self._control.hold()
            return
        self._setpoint_step = self._status.step
        lifts = self._is.lifts_off_by_setpoint and target.velocity_ned_m_s[2] < LIFT_OFF_M_S
        may_move = self._control.manoeuvre in (Manoeuvre.HOLD, Manoeuvre.VELOCITY) or lifts
        if offboard and self._status.armed and may_move:
            self._control.follow(target.velocity_ned_m_s, target.yaw_rate_rad_s)

    # Origin, time, streams

    def _set_origin(self, message: Message) -> None:
        if self._status.origin is None and self._estimator.has_settled:
            self._status.origin = message.latitude, message.longitude, message.altitude
            self._outgoing.text(mavlink.MAV_SEVERITY_INFO, "EKF3 IMU0 origin set")
            self._outgoing.add(
                mavlink.MAVLink_gps_global_origin_message(
                    *self._status.origin, self._status.boot_us
                )
            )

    def _timesync(self, message: Message) -> None:
        if message.tc1 == 0:
            now_ns = self._status.boot_us * 1000
            self._outgoing.add(mavlink.MAVLink_timesync_message(now_ns, message.ts1))

    def _set_interval(self, message: Message) -> int:
        message_id = _whole(message.param1)
        result = self._streams.set_interval(message_id, message.param2)
        if result == DENIED:
            text = f"No ap_message for mavlink id ({message_id})"
            self._outgoing.text(mavlink.MAV_SEVERITY_WARNING, text)
        return result

    def _tell_interval(self, message: Message) -> int:
        message_id = _whole(message.param1)
        interval = self._streams.interval_us(message_id)
        self._outgoing.add(mavlink.MAVLink_message_interval_message(message_id & 0xFFFF, interval))
        return ACCEPTED

    def _send_requested(self, message: Message) -> int:
        answer = self._streams.make(_whole(message.param1))
        if answer is None:
            return FAILED
        self._outgoing.add(answer)
        return ACCEPTED


def _whole(parameter: float) -> int:
    """A number out of a float parameter; 0 for what is none."""
    return int(parameter) if math.isfinite(parameter) else 0
