"""Decides on modes, arming, take-off, setpoints and failsafes.

`protocol` decodes the requests; `firmware` selects the responses.
"""

from random import Random

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.control import Control, Manoeuvre
from sitl.autopilot.failsafes import FailsafeWatch
from sitl.autopilot.firmware import (
    Behaviour,
    Condition,
    Refusal,
    Throttle,
    VelocityTarget,
)
from sitl.autopilot.parts import Parts
from sitl.autopilot.streams import Message
from sitl.core.vehicle import STEP_S, Vehicle

STREAM_STEPS = 50
"""Setpoints at most this many steps apart are a stream."""
LIFT_OFF_M_S = -0.1
"""Down velocity of a climbing setpoint that starts a take-off, m/s, if the firmware supports it."""
MAX_TAKE_OFF_M = 1000.0
"""Take-off heights from here on are refused, m. Chosen."""
BY_STICK = (Behaviour.CLIMB_BY_STICK, Behaviour.THRUST_BY_STICK)
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
FAILED: int = mavlink.MAV_RESULT_FAILED


class Commander:
    """Decides on the vehicle's actions; `control` executes them."""

    def __init__(self, parts: Parts, vehicle: Vehicle, landing: Random) -> None:
        """`landing` draws the horizontal drift of each landing."""
        self._is = parts.firmware
        self._parameters = parts.parameters.values
        self._status = parts.status
        self._navigation = parts.navigation
        self._telemetry = parts.telemetry
        self._broadcast = parts.broadcast
        self._vehicle = vehicle
        self._failsafes = FailsafeWatch(self._is.failsafes)
        self._setpoint_step: int | None = None
        self._lost_setpoints_in: int | None = None
        """The offboard mode that the setpoint timeout ended; cleared by any other mode change."""
        self.throttle = Throttle.LOW
        """The pilot's throttle stick; it counts as low without a transmitter."""
        self.control = Control(self._navigation.estimator, self._is.response, landing)
        self.arming_fault = ""
        """A fault for tests: the failure that the vehicle's own checks report."""

    # Modes

    def ask_for(self, mode: int) -> int:
        """Handle a mode request; return the MAV_RESULT."""
        if self._is.behaviour(mode) is Behaviour.OFFBOARD and not self._may_go_offboard():
            return self._is.refused
        return self.enter(mode)

    def _may_go_offboard(self) -> bool:
        """Offboard mode is allowed. While disarmed, PX4 accepts any mode."""
        if not self._is.setpoints_before_offboard or not self._status.armed:
            return True
        return self._is_streaming() and self._navigation.has_position

    def _is_streaming(self) -> bool:
        since = self._setpoint_step
        return since is not None and self._status.step - since <= STREAM_STEPS

    def enter(self, mode: int) -> int:
        """Change the mode without checking whether it is allowed."""
        behaviour = self._is.behaviour(mode)
        if behaviour is None:
            if text := self._is.no_such_mode(mode):
                self._broadcast.text(mavlink.MAV_SEVERITY_WARNING, text)
            return self._is.refused
        if mode == self._status.mode:
            return ACCEPTED
        self._status.mode = mode
        self._lost_setpoints_in = None
        if self._is.heartbeat_on_mode_change:
            self._broadcast.add(self._telemetry.heartbeat())
        self._begin(behaviour)
        return ACCEPTED

    def _begin(self, behaviour: Behaviour) -> None:
        """Start a new mode's first manoeuvre."""
        is_low = self.throttle is Throttle.LOW
        if behaviour is Behaviour.LAND:
            if self._status.armed:
                self.control.land()
        elif behaviour is Behaviour.CLIMB_BY_STICK and is_low:
            self.control.sink(self._is.sink_m_s(self._parameters))
        elif behaviour is Behaviour.THRUST_BY_STICK and is_low:
            self.control.fall()
        elif behaviour is not Behaviour.TAKE_OFF:
            self.control.hold()

    def pilot_mode(self, mode: int, throttle: Throttle) -> None:
        """Apply the pilot's mode switch and throttle stick."""
        self.throttle = throttle
        if mode != self._status.mode:
            self.enter(mode)
        elif (behaviour := self._is.behaviour(mode)) in BY_STICK:
            self._begin(behaviour)

    # Arming

    def failure(self) -> str:
        """The reason against arming now; empty if there is none."""
        status, navigation = self._status, self._navigation
        if status.crashed:
            return "Crashed: restart the simulator"
        if self.arming_fault:
            return self.arming_fault
        if not navigation.estimator.has_settled:
            return "AHRS: not healthy"
        if reason := self._is.peripheral_failure(
            navigation.outside, navigation.time_s, self._parameters
        ):
            return reason
        if self._is.needs_origin(status.mode) and navigation.origin is None:
            return "AHRS: waiting for home"
        return self._position_failure()

    def _position_failure(self) -> str:
        mode = self._status.mode
        if self._is.needs_position(mode) and not self._navigation.has_position:
            return "Need Position Estimate"
        offboard = self._is.behaviour(mode) is Behaviour.OFFBOARD
        if offboard and self._is.setpoints_before_offboard and not self._is_streaming():
            return "No offboard signal"
        return ""

    def check(self) -> int:
        """MAV_CMD_RUN_PREARM_CHECKS (401)."""
        self._deny(self.failure(), arming=False)
        return ACCEPTED

    def _deny(self, failure: str, *, arming: bool) -> None:
        for text in self._is.denial(failure, arming=arming) if failure else ():
            self._broadcast.text(mavlink.MAV_SEVERITY_CRITICAL, text)

    def arm(self, *, forced: bool) -> int:
        """Arm. Force skips the checks that the firmware skips, but never the position."""
        if self._status.armed:
            return ACCEPTED
        skips = forced and self._is.force_skips_checks and not self._status.crashed
        failure = self._position_failure() if skips else self.failure()
        self._deny(failure, arming=True)
        if failure:
            return self._is.refused
        self._status.armed = True
        self.control.arm(self._status.step * STEP_S)
        return ACCEPTED

    def disarm(self, *, forced: bool) -> int:
        """Disarm. In the air only by force; the vehicle then falls."""
        if not self._vehicle.on_ground and not forced:
            return self._is.refused
        self.stop()
        return ACCEPTED

    def stop(self) -> None:
        self._status.armed = False
        self._lost_setpoints_in = None
        self.control.stop()

    # Flight

    def take_off(self, asked_m: float) -> int:
        height_m = self._is.take_off_height_m(asked_m, self._parameters)
        offboard = self._is.behaviour(self._status.mode) is Behaviour.OFFBOARD
        ready = self._status.armed and self._vehicle.on_ground
        in_right_mode = self._is.take_off_mode is not None or offboard
        if not ready or not in_right_mode or not 0 < height_m < MAX_TAKE_OFF_M:  # false for NaN
            return FAILED if self._is.take_off_mode is None else self._is.refused
        if self._is.take_off_mode is not None:
            self.enter(self._is.take_off_mode)
        self.control.take_off(self._status.step * STEP_S, height_m)
        return ACCEPTED

    def after_climb(self) -> None:
        """Change from the take-off mode to hold."""
        if self._status.mode == self._is.take_off_mode:
            self.enter(self._is.hold_mode)

    def setpoint(self, message: Message) -> None:
        """SET_POSITION_TARGET_LOCAL_NED (84)."""
        estimator = self._navigation.estimator
        target = self._is.setpoint(
            message, estimator.yaw_rad, estimator.position_ned_m, self._parameters
        )
        offboard = self._is.behaviour(self._status.mode) is Behaviour.OFFBOARD
        if isinstance(target, Refusal):
            if target.text:
                self._broadcast.text(mavlink.MAV_SEVERITY_ERROR, target.text)
            if target.stops and offboard:
                self.control.hold()
            return
        self._setpoint_step = self._status.step
        if self._lost_setpoints_in is not None and self._status.armed:
            self.enter(self._lost_setpoints_in)
            offboard = True
        climbs = isinstance(target, VelocityTarget) and target.velocity_ned_m_s[2] < LIFT_OFF_M_S
        lifts = self._is.lifts_off_by_setpoint and climbs
        may_move = self.control.manoeuvre in (Manoeuvre.HOLD, Manoeuvre.FOLLOW) or lifts
        if offboard and self._status.armed and may_move:
            self.control.follow(target)

    def expire_setpoint(self) -> None:
        """After a timeout of the last setpoint, brake or change the mode.

        Armed in the offboard mode, a vehicle changes its mode on the ground, too.
        """
        if self._setpoint_step is None or not self._needs_setpoints():
            return
        timeout_s, mode = self._is.setpoint_loss(self._parameters)
        if (self._status.step - self._setpoint_step) * STEP_S > timeout_s:
            self.control.hold()
            if mode is not None:
                offboard = self._status.mode
                self.enter(mode)
                self._lost_setpoints_in = offboard if self._is.returns_to_offboard else None

    def _needs_setpoints(self) -> bool:
        offboard = self._is.behaviour(self._status.mode) is Behaviour.OFFBOARD
        stands = self.control.manoeuvre is Manoeuvre.GROUND and self._status.armed and offboard
        return stands or self.control.manoeuvre is Manoeuvre.FOLLOW

    def check_failsafes(self) -> None:
        """Check the failsafes and react as the parameters select."""
        status, navigation = self._status, self._navigation
        now_s, outside = navigation.time_s, navigation.outside
        condition = Condition(
            flying=status.manoeuvre is not Manoeuvre.GROUND,
            unaided_s=navigation.unaided_s,
            battery=status.battery,
            battery_v=self._telemetry.battery_v,
            ground_station_age_s=outside.ground_station_age_s(now_s),
            onboard_computer_age_s=outside.onboard_computer_age_s(now_s),
        )
        mode = self._failsafes.check(condition, self._parameters, self._broadcast)
        status.in_failsafe = self._failsafes.has_taken_over
        if mode is not None and mode != status.mode:
            self.enter(mode)
