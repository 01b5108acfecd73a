"""Assembles the emulated flight controller: MAVLink in, MAVLink out, and the vehicle it flies.

`Autopilot.step` advances the time.
"""

import math
from collections.abc import Callable, Mapping
from copy import copy
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.range_sensors import AutopilotRange
from companion.core.messages import Beam
from companion.link.transports.transport import sent_by
from sitl.autopilot.ardupilot import ArduPilot
from sitl.autopilot.commander import Commander
from sitl.autopilot.control import Manoeuvre
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE, AutopilotEstimator, OdometryNoise
from sitl.autopilot.estimation.navigation import Navigation
from sitl.autopilot.estimation.own_sensors import Imu
from sitl.autopilot.firmware import EmulatedFirmware, Throttle, boot_values, system_id
from sitl.autopilot.messages import Broadcast, Outbox
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.autopilot.parts import Parts
from sitl.autopilot.protocol import Channel, Protocol
from sitl.autopilot.px4 import Px4
from sitl.autopilot.response import SetpointShaper
from sitl.autopilot.streams import Message, Streams
from sitl.autopilot.telemetry import Status, Telemetry
from sitl.core.noise import stream
from sitl.core.truth import TrueState
from sitl.core.vehicle import STEP_S, Vehicle
from sitl.sensors.time_of_flight import TofUnit

FIRMWARES: dict[str, Callable[[], EmulatedFirmware]] = {"ardupilot": ArduPilot, "px4": Px4}
"""Emulated firmwares by name."""

HEARTBEAT_STEPS = 100
"""Steps between HEARTBEATs: 1 s."""
FAILSAFE_STEPS = 10
"""Steps between failsafe checks."""
RESTART_STEPS = 150
"""Steps without messages after a reboot."""
GROUND_STATION_GONE_S = 2.5
"""Timeout of a ground station's HEARTBEAT, s. PX4's HEARTBEAT_TIMEOUT_US."""
FLIGHT_BATTERY_S = 600.0
"""Flight time of a full battery, s. Chosen."""
NO_PARAMETERS: Mapping[str, float] = MappingProxyType({})


def keep_nothing(name: str, value: float) -> None:
    """The `ParameterWatch` of a vehicle that does not save its parameters."""


class Autopilot:
    """One vehicle with its flight controller. Time advances only by `step`.

    `parameters` apply from the start. `watch` is called for each parameter that a client sets. With
    `sends_truth` the vehicle sends its true state on request, as simulated autopilots do. A full
    battery lasts `battery_s` in flight.

    Raises:
        ParameterError: the firmware has no such parameter.
    """

    def __init__(
        self,
        seed: int,
        start: TrueState,
        *,
        firmware: str = "ardupilot",
        parameters: Mapping[str, float] = NO_PARAMETERS,
        watch: ParameterWatch = keep_nothing,
        links: int = 1,
        sends_truth: bool = False,
        noise: OdometryNoise = REFERENCE_NOISE,
        battery_s: float = FLIGHT_BATTERY_S,
    ) -> None:
        self.kind = firmware
        """ "ardupilot" or "px4"."""
        self.mute: set[str] = set()
        """A fault for tests: types of messages that are not sent."""
        self._battery_s = battery_s
        self._is = FIRMWARES[firmware]()
        self._timesync_steps = round(self._is.timesync_period_s / STEP_S)
        self._vehicle = Vehicle(start, stream(seed, "gusts"), self._is.response.airframe)
        self._shaper = SetpointShaper(self._is.response)
        values = boot_values(self._is, parameters)
        self._navigation = Navigation(start, seed, self._is, values, noise)
        self._status = Status(self._is.boot_mode)
        self._telemetry = Telemetry(
            self._is,
            values,
            self._status,
            self._navigation,
            start,
            imu=Imu(stream(seed, "autopilot's gyro")),
        )
        makers = self._telemetry.makers(sends_truth=sends_truth)
        all_streams_hz = self._is.streams_hz | self._is.more_streams_hz
        self._channels = [
            Channel(Streams(makers, all_streams_hz if link else self._is.streams_hz), Outbox())
            for link in range(links)
        ]
        self._broadcast = Broadcast(
            [channel.outbox for channel in self._channels],
            self._is.text_habit,
            self._receives_texts,
        )
        parts = Parts(
            self._is,
            self._is.parameter_protocol(self._is.table, values, watch),
            self._status,
            self._navigation,
            self._telemetry,
            self._broadcast,
        )
        self._commander = Commander(parts, self._vehicle, stream(seed, "landing"))
        self._silent_until_step = 0
        self.system_id = system_id(self._is, values)
        self._protocol = Protocol(self.system_id, parts, self._commander)

    def _receives_texts(self, outbox: Outbox) -> bool:
        age_s = self.time_s - outbox.ground_station_s
        return not self._is.text_habit.needs_ground_station or age_s <= GROUND_STATION_GONE_S

    @property
    def time_s(self) -> float:
        return self._status.step * STEP_S

    @property
    def mode(self) -> int:
        """HEARTBEAT.custom_mode."""
        return self._status.mode

    @property
    def battery(self) -> float:
        """Remaining charge, 0 to 1."""
        return self._status.battery

    @property
    def truth(self) -> TrueState:
        return self._vehicle.state

    @property
    def estimate(self) -> AutopilotEstimator:
        """The autopilot's own estimate of pose and velocity."""
        return self._navigation.estimator

    def step(self) -> None:
        """Advance by 10 ms."""
        status = self._status
        status.step += 1
        self._commander.expire_setpoint()
        if status.armed:
            self._fly()
        else:
            self._vehicle.rest()
        self._telemetry.truth = truth = self._vehicle.state
        self._navigation.update(truth)
        status.manoeuvre = self._commander.control.manoeuvre
        self._send_due()

    def _fly(self) -> None:
        control, estimator = self._commander.control, self._navigation.estimator
        was = control.manoeuvre
        if was is Manoeuvre.FALL and self._vehicle.on_ground:
            control.stop()
        has_thrust = control.has_thrust(self.time_s) and was is not Manoeuvre.FALL
        if was is Manoeuvre.GROUND or not has_thrust:
            self._shaper.reset()
            self._vehicle.rest()
            return
        wanted = control.wanted(on_ground=self._vehicle.on_ground)
        velocity, yaw_rate = self._shaper.step(*wanted)
        self._vehicle.step(estimator.to_true_frame(velocity), estimator.to_true_rate(yaw_rate))
        self._status.battery = max(0.0, self._status.battery - STEP_S / self._battery_s)
        if was is Manoeuvre.LAND and control.manoeuvre is Manoeuvre.GROUND:
            self._commander.stop()
        if was is Manoeuvre.CLIMB and control.manoeuvre is Manoeuvre.HOLD:
            self._commander.after_climb()

    def _send_due(self) -> None:
        step = self._status.step
        if step < self._silent_until_step:
            return
        if step % FAILSAFE_STEPS == 0:
            self._commander.check_failsafes()
        if step % HEARTBEAT_STEPS == 0:
            self._status.is_armable = not self._commander.failure()
            self._broadcast.add(self._telemetry.heartbeat())
        if step % self._timesync_steps == 0:
            self._broadcast.add(self._protocol.timesync())
        for channel in self._channels:
            if due := channel.streams.due(step):
                channel.outbox.extend(due)
        self._protocol.list_parameters()

    def connect(self, rangefinders: Mapping[Beam, tuple[TofUnit, AutopilotRange]]) -> None:
        """Connect rangefinders to the autopilot; it reports their readings."""
        self._telemetry.rangefinders = rangefinders

    def receive(self, message: Message, link: int = 0) -> None:
        """Handle any message from a client on one of the links."""
        if self._status.step < self._silent_until_step:
            return
        self._protocol.receive(message, self._channels[link])
        if self._is.forwards_components and self._is_for_all(message):
            passed = sent_by(copy(message), message.get_srcComponent(), message.get_seq())
            for number, channel in enumerate(self._channels):
                if number != link:
                    channel.outbox.add(passed)

    def _is_for_all(self, message: Message) -> bool:
        """The message is a broadcast from another component of this vehicle."""
        ours = message.get_srcSystem() == self.system_id
        return ours and not getattr(message, "target_system", 0)

    def take_outbox(self, link: int = 0) -> list[Message]:
        """Messages sent on one of the links since the last call."""
        messages = self._channels[link].outbox.take()
        return [m for m in messages if m.get_type() not in self.mute] if self.mute else messages

    def crash(self, reason: str) -> None:
        """Stop the motors for good after a collision."""
        self._status.crashed = True
        self._commander.stop()
        self._broadcast.text(mavlink.MAV_SEVERITY_EMERGENCY, f"Crash: {reason}")

    # Faults for tests

    def restart(self) -> None:
        """Reboot in place with the motors off."""
        status = self._status
        self._commander.stop()
        status.mode, status.booted_step = self._is.boot_mode, status.step
        self._silent_until_step = status.step + RESTART_STEPS
        self._navigation.restart()
        for channel in self._channels:
            channel.outbox.take()
            channel.outbox.ground_station_s = -math.inf
            channel.streams.restart()

    def jump_clock(self, seconds: float) -> None:
        """Make the time since boot jump by `seconds`."""
        self._status.booted_step -= round(seconds / STEP_S)

    def set_battery(self, share: float) -> None:
        self._status.battery = share

    def blow(self, north_m_s: float, east_m_s: float) -> None:
        """Wind moves the vehicle."""
        self._vehicle.wind_ne_m_s = (north_m_s, east_m_s)

    def push_down(self, speed_m_s: float) -> None:
        """The air of a vehicle above pushes this one down."""
        self._vehicle.downwash_m_s = speed_m_s

    def lose_flow(self, *, lost: bool) -> None:
        self._navigation.lose_flow(lost=lost)

    def claim(self, vehicle_type: int | None, autopilot: int | None) -> None:
        """Claim another type or autopilot in HEARTBEAT; None restores the true one."""
        self._telemetry.claimed = vehicle_type, autopilot

    def stay_taking_off(self, *, stays: bool) -> None:
        """Report "taking off" during the whole flight, as ArduCopter 4.1 does."""
        self._telemetry.stays_taking_off = stays

    def refuse_arming(self, *, refuse: bool) -> None:
        self._commander.arming_fault = "Compass not calibrated" if refuse else ""

    # The pilot

    def pilot_mode(self, custom_mode: int, throttle: Throttle = Throttle.LOW) -> None:
        """Set the pilot's mode switch and throttle stick."""
        self._commander.pilot_mode(custom_mode, throttle)

    def switch_transmitter(self, *, on: bool) -> None:
        """Switch the pilot's transmitter, of which SYS_STATUS reports the receiver."""
        self._status.has_transmitter = on

    def pilot_arms(self) -> None:
        """Arm by the sticks, without checks."""
        self._status.armed = True
