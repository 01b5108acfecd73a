"""The emulated flight controller: MAVLink in, MAVLink out, and a vehicle that it flies.

Answers follow what was measured on a running ArduCopter. Nothing that comes in raises.
"""

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot import ardupilot
from sitl.autopilot.control import Control, Manoeuvre
from sitl.autopilot.estimator import REFERENCE_NOISE, FlowEstimator, OdometryNoise
from sitl.autopilot.messages import Outgoing
from sitl.autopilot.streams import Message, Streams
from sitl.noise import stream
from sitl.truth import TrueState
from sitl.vehicle import STEP_S, Vehicle

HEARTBEAT_STEPS = 100
BATTERY_CELLS = 4
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
FAILED: int = mavlink.MAV_RESULT_FAILED
DENIED: int = mavlink.MAV_RESULT_DENIED
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED
FLIGHT_BATTERY_S = 600.0
"""How long a full battery flies."""
FORCE_ARM = 2989


class Autopilot:
    """One vehicle with its flight controller; time passes only by `step`."""

    def __init__(self, seed: int, start: TrueState, noise: OdometryNoise = REFERENCE_NOISE) -> None:
        self._vehicle = Vehicle(start, stream(seed, "gusts"))
        self._estimator = FlowEstimator(start, stream(seed, "flow"), noise)
        self._control = Control(self._estimator)
        self._parameters = {name: value for name, (value, _) in ardupilot.PARAMETERS.items()}
        self._outgoing = Outgoing()
        self._streams = Streams(
            {
                mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
                mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
                mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_state,
                mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: self._ekf_status,
                mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
                mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery_status,
                mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._version,
                mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._home,
            }
        )
        self._steps = 0
        self._mode = ardupilot.STABILIZE
        self._armed = False
        self._crashed = False
        self._origin: tuple[int, int, int] | None = None
        self._setpoint_step: int | None = None
        self._battery = 1.0

    # Time

    @property
    def time_s(self) -> float:
        return self._steps * STEP_S

    @property
    def mode(self) -> int:
        """HEARTBEAT.custom_mode."""
        return self._mode

    @property
    def truth(self) -> TrueState:
        return self._vehicle.state

    def step(self) -> None:
        """10 ms of flight."""
        self._steps += 1
        self._expire_setpoint()
        if self._armed:
            self._fly()
        else:
            self._vehicle.rest()
        self._estimator.update(self._vehicle.state)
        if self._steps % HEARTBEAT_STEPS == 0:
            self._outgoing.add(self._heartbeat())
        self._outgoing.extend(self._streams.due(self._steps))

    def take_outbox(self) -> list[Message]:
        """What has been said since the last call."""
        return self._outgoing.take()

    def _fly(self) -> None:
        was = self._control.manoeuvre
        velocity, yaw_rate = self._control.wanted(self.time_s, on_ground=self._vehicle.on_ground)
        if was is Manoeuvre.GROUND:
            self._vehicle.rest()
            return
        self._vehicle.step(
            self._estimator.to_true_frame(velocity), self._estimator.to_true_rate(yaw_rate)
        )
        self._battery = max(0.0, self._battery - STEP_S / FLIGHT_BATTERY_S)
        if self._control.manoeuvre is Manoeuvre.GROUND:
            self._disarm()

    def _expire_setpoint(self) -> None:
        """ArduCopter flies the last setpoint for GUID_TIMEOUT, then brakes, without a word."""
        if self._setpoint_step is None or self._control.manoeuvre is not Manoeuvre.VELOCITY:
            return
        timeout_s = max(self._parameters["GUID_TIMEOUT"], ardupilot.LEAST_GUID_TIMEOUT_S)
        if (self._steps - self._setpoint_step) * STEP_S > timeout_s:
            self._control.hold()

    # What happens to it

    def crash(self, reason: str) -> None:
        """It has hit something: motors off for good."""
        self._crashed = True
        self._disarm()
        self._outgoing.text(mavlink.MAV_SEVERITY_EMERGENCY, f"Crash: {reason}")

    def pilot_mode(self, custom_mode: int) -> None:
        """The pilot's mode switch."""
        self._enter(custom_mode)

    def _disarm(self) -> None:
        self._armed = False
        self._control.stop()

    # Messages in

    def receive(self, message: Message) -> None:
        """Anything a client may send; what is not for this vehicle or not known is ignored."""
        handlers: dict[str, Callable[[Message], object]] = {
            "COMMAND_LONG": self._command_long,
            "SET_MODE": lambda m: self._set_mode(m.base_mode, m.custom_mode),
            "SET_POSITION_TARGET_LOCAL_NED": self._setpoint,
            "SET_GPS_GLOBAL_ORIGIN": self._set_origin,
            "PARAM_SET": self._set_parameter,
            "PARAM_REQUEST_READ": self._read_parameter,
            "PARAM_REQUEST_LIST": lambda m: self._list_parameters(),
            "TIMESYNC": self._timesync,
        }
        handler = handlers.get(message.get_type())
        if handler is not None and getattr(message, "target_system", 1) in (0, 1):
            handler(message)

    def _command_long(self, message: Message) -> None:
        commands: dict[int, Callable[[Message], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_or_disarm,
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: self._check,
            mavlink.MAV_CMD_DO_SET_MODE: lambda m: self._set_mode(int(m.param1), int(m.param2)),
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LAND: lambda m: self._enter(ardupilot.LAND),
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._tell_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._send_requested,
        }
        command = commands.get(message.command)
        numbers = [getattr(message, f"param{i}") for i in (1, 2)]
        texts_before = self._outgoing.begin_answer()
        if command is None:
            result = UNSUPPORTED
        elif all(map(math.isfinite, numbers)):
            result = command(message)
        else:
            result = DENIED
        sender = message.get_srcSystem(), message.get_srcComponent()
        ack = mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *sender)
        self._outgoing.answer(ack, texts_before)

    # Modes, arming, take-off

    def _set_mode(self, base_mode: int, custom_mode: int) -> int:
        if not base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return DENIED
        return self._enter(custom_mode)

    def _enter(self, custom_mode: int) -> int:
        if custom_mode not in ardupilot.MODES:
            self._outgoing.text(mavlink.MAV_SEVERITY_WARNING, f"No such mode {custom_mode}")
            return FAILED
        if custom_mode != self._mode:
            self._mode = custom_mode
            self._setpoint_step = None
            self._outgoing.add(self._heartbeat())
            if custom_mode == ardupilot.LAND:
                self._control.land()
            else:
                self._control.hold()
        return ACCEPTED

    def _arming_complaint(self) -> str:
        if self._crashed:
            return "Crashed: restart the simulator"
        if not self._estimator.has_settled:
            return "AHRS: not healthy"
        if self._origin is None:
            return "AHRS: waiting for home"
        return ""

    def _check(self, message: Message) -> int:
        complaint = self._arming_complaint()
        if complaint:
            self._outgoing.text(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {complaint}")
        return ACCEPTED

    def _arm_or_disarm(self, message: Message) -> int:
        if message.param1 == 0:
            if not self._vehicle.on_ground:
                return FAILED
            self._disarm()
            return ACCEPTED
        complaint = self._arming_complaint()
        if complaint:
            forced = message.param2 == FORCE_ARM
            text = "Need Position Estimate" if forced else complaint
            self._outgoing.text(mavlink.MAV_SEVERITY_CRITICAL, f"Arm: {text}")
            return FAILED
        self._armed = True
        return ACCEPTED

    def _take_off(self, message: Message) -> int:
        ready = self._armed and self._mode == ardupilot.GUIDED and self._vehicle.on_ground
        if not ready or not 0 < message.param7 < 1000:  # false for NaN too
            return FAILED
        self._control.take_off(self.time_s, message.param7)
        return ACCEPTED

    def _setpoint(self, message: Message) -> None:
        flying = self._control.manoeuvre in (Manoeuvre.HOLD, Manoeuvre.VELOCITY)
        if self._mode != ardupilot.GUIDED or not flying:
            return
        target = ardupilot.velocity_target(message, self._estimator.yaw_rad)
        if target is None:
            self._control.hold()
            return
        self._setpoint_step = self._steps
        self._control.follow(target.velocity_ned_m_s, target.yaw_rate_rad_s)

    # Origin, parameters, time

    def _set_origin(self, message: Message) -> None:
        if self._origin is None and self._estimator.has_settled:
            self._origin = message.latitude, message.longitude, message.altitude
            self._outgoing.text(mavlink.MAV_SEVERITY_INFO, "EKF3 IMU0 origin set")
            self._outgoing.add(
                mavlink.MAVLink_gps_global_origin_message(*self._origin, self._boot_us())
            )

    def _set_parameter(self, message: Message) -> None:
        if message.param_id in self._parameters and math.isfinite(message.param_value):
            self._parameters[message.param_id] = message.param_value
            self._tell_parameter(message.param_id, 65535)

    def _read_parameter(self, message: Message) -> None:
        names = list(self._parameters)
        if 0 <= message.param_index < len(names):
            self._tell_parameter(names[message.param_index], message.param_index)
        elif message.param_index == -1 and message.param_id in self._parameters:
            self._tell_parameter(message.param_id, 65535)

    def _list_parameters(self) -> None:
        for index, name in enumerate(self._parameters):
            self._tell_parameter(name, index)

    def _tell_parameter(self, name: str, index: int) -> None:
        _, kind = ardupilot.PARAMETERS[name]
        value = self._parameters[name]
        self._outgoing.add(
            mavlink.MAVLink_param_value_message(
                name.encode(), value, kind, len(self._parameters), index
            )
        )

    def _timesync(self, message: Message) -> None:
        if message.tc1 == 0:
            self._outgoing.add(
                mavlink.MAVLink_timesync_message(self._boot_us() * 1000, message.ts1)
            )

    # Streams

    def _set_interval(self, message: Message) -> int:
        result = self._streams.set_interval(int(message.param1), message.param2)
        if result == DENIED:
            text = f"No ap_message for mavlink id ({int(message.param1)})"
            self._outgoing.text(mavlink.MAV_SEVERITY_WARNING, text)
        return result

    def _tell_interval(self, message: Message) -> int:
        message_id = int(message.param1)
        interval = self._streams.interval_us(message_id)
        self._outgoing.add(mavlink.MAVLink_message_interval_message(message_id & 0xFFFF, interval))
        return ACCEPTED

    def _send_requested(self, message: Message) -> int:
        answer = self._streams.make(int(message.param1))
        if answer is None:
            return FAILED
        self._outgoing.add(answer)
        return ACCEPTED

    # Messages out

    def _boot_ms(self) -> int:
        return self._steps * 10

    def _boot_us(self) -> int:
        return self._steps * 10_000

    def _heartbeat(self) -> Message:
        base = ardupilot.BASE_MODE_IDLE
        if self._mode in (ardupilot.GUIDED, ardupilot.GUIDED_NOGPS):
            base |= ardupilot.BASE_MODE_GUIDED_BIT
        if self._armed:
            base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        flying = self._control.manoeuvre is not Manoeuvre.GROUND
        state = mavlink.MAV_STATE_ACTIVE if flying else mavlink.MAV_STATE_STANDBY
        state = mavlink.MAV_STATE_CRITICAL if self._crashed else state
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR, ardupilot.AUTOPILOT, base, self._mode, state, 3
        )

    @property
    def _has_position(self) -> bool:
        return self._estimator.has_settled and self._origin is not None

    def _local_position(self) -> Message | None:
        if not self._has_position:
            return None
        position, velocity = self._estimator.position_ned_m, self._estimator.velocity_ned_m_s
        return mavlink.MAVLink_local_position_ned_message(self._boot_ms(), *position, *velocity)

    def _attitude(self) -> Message:
        truth, estimate = self._vehicle.state, self._estimator
        return mavlink.MAVLink_attitude_message(
            self._boot_ms(),
            truth.roll_rad,
            truth.pitch_rad,
            estimate.yaw_rad,
            *(0.0, 0.0, estimate.yaw_rate_rad_s),
        )

    def _extended_state(self) -> Message:
        landed = {
            Manoeuvre.GROUND: mavlink.MAV_LANDED_STATE_ON_GROUND,
            Manoeuvre.CLIMB: mavlink.MAV_LANDED_STATE_TAKEOFF,
            Manoeuvre.LAND: mavlink.MAV_LANDED_STATE_LANDING,
        }.get(self._control.manoeuvre, mavlink.MAV_LANDED_STATE_IN_AIR)
        return mavlink.MAVLink_extended_sys_state_message(0, landed)

    def _ekf_status(self) -> Message:
        flags = ardupilot.EKF_READY if self._has_position else ardupilot.EKF_WITHOUT_POSITION
        return mavlink.MAVLink_ekf_status_report_message(flags, 0.1, 0.1, 0.1, 0.1, 0.0)

    def _millivolts(self) -> int:
        return round(1000 * BATTERY_CELLS * (3.5 + 0.7 * self._battery))

    def _sys_status(self) -> Message:
        present = (
            mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
            | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
            | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
            | mavlink.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW
        )
        health = present
        if not self._arming_complaint():
            health |= mavlink.MAV_SYS_STATUS_PREARM_CHECK
        return mavlink.MAVLink_sys_status_message(
            present,
            present,
            health,
            200,
            self._millivolts(),
            1200,
            round(100 * self._battery),
            *(0, 0, 0, 0, 0, 0),
        )

    def _battery_status(self) -> Message:
        cell = self._millivolts() // BATTERY_CELLS
        cells = [cell] * BATTERY_CELLS + [65535] * (10 - BATTERY_CELLS)
        return mavlink.MAVLink_battery_status_message(
            0, 0, 1, 2500, cells, 1200, -1, -1, round(100 * self._battery)
        )

    def _version(self) -> Message:
        return mavlink.MAVLink_autopilot_version_message(
            ardupilot.CAPABILITIES,
            ardupilot.FLIGHT_SW_VERSION,
            0,
            0,
            0,
            bytes(8),
            bytes(8),
            bytes(8),
            0,
            0,
            0,
        )

    def _home(self) -> Message | None:
        if self._origin is None:
            return None
        return mavlink.MAVLink_home_position_message(
            *self._origin, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, self._boot_us()
        )
