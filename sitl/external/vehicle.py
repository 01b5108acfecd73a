"""Puts a vehicle with an external flight simulation into the world, at that flight's time."""

import math
import time
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.requests import command_long
from companion.link.transports.transport import UdpTransport
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE, AutopilotEstimator
from sitl.autopilot.protocol import FORCE_DISARM
from sitl.autopilot.streams import Message
from sitl.core.noise import stream
from sitl.core.truth import History
from sitl.core.vehicle import STEP_S
from sitl.external.clock import AutopilotClock, Silence
from sitl.external.feed import distances, odometry
from sitl.external.setup import ExternalSetup
from sitl.external.tracker import TruthTracker
from sitl.sensors.board import SensorBoard
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup, beam_query, start_state
from sitl.world.geometry.model import WorldModel

COMPONENT: int = mavlink.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
ODOMETRY_STEPS, DISTANCE_STEPS = 2, 10
"""Steps between messages: 50 and 10 Hz."""
HEARTBEAT_PERIOD_S = 1.0
"""Interval of HEARTBEAT (0), s. Chosen."""
WAIT_S = 0.5
"""Longest wait for the autopilot within one `advance`, wall time, s. Chosen."""
KEPT_STEPS = 40
"""Steps that may arrive at once on a busy machine; the gyro's FIFO holds fewer."""


class ExternalVehicle:
    """Served like a `Simulation`, but `advance` waits for the external autopilot's time."""

    def __init__(
        self, setup: Setup, transport: UdpTransport, report: Callable[[str], None]
    ) -> None:
        start = start_state(setup)
        self._transport = transport
        self._model = WorldModel(setup.world)
        self._clock = AutopilotClock()
        self._silence = Silence(report, time.monotonic())
        self._heartbeat_s = -math.inf
        self._tracker = TruthTracker(start)
        self._setup = ExternalSetup(report)
        self._report = report
        self._estimator = AutopilotEstimator(start, setup.seed, REFERENCE_NOISE)
        self._noise = stream(setup.seed, "range sensors of the autopilot")
        self._history = History(start, KEPT_STEPS)
        self._steps = 0
        self.record = TruthRecord(start)
        self.board = SensorBoard(
            setup.seed,
            setup.sensors,
            lambda beam: beam_query(setup, self._model, beam),
            self._history.at,
        )

    @property
    def time_s(self) -> float:
        return self._steps * STEP_S

    def advance(self, time_s: float) -> None:
        """Follow the flight until `time_s`, or farther if it is already there.

        Time stops earlier if the autopilot is silent.
        """
        self._receive_all()
        give_up_s = time.monotonic() + WAIT_S
        while self.time_s < time_s - 1e-9:
            self._send_requests()
            left_s = give_up_s - time.monotonic()
            if left_s <= 0:
                break
            self._transport.await_datagrams(self._transport.datagrams_received + 1, left_s)
            self._receive_all()
        self._send_requests()
        self.board.bus.set_time(self.time_s)

    def _send_requests(self) -> None:
        """Send requests by the wall clock: the autopilot sends its time only after them."""
        now_s = time.monotonic()
        self._silence.check(now_s)
        messages = self._setup.requests(now_s, self._tracker.home)
        if now_s - self._heartbeat_s >= HEARTBEAT_PERIOD_S:
            self._heartbeat_s = now_s
            messages.append(_heartbeat())
        for message in messages:
            self._transport.send(message)

    def _receive_all(self) -> None:
        for message in self._transport.receive():
            if message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1:
                self._receive(message)

    def _receive(self, message: Message) -> None:
        autopilot_s = self._clock.receive(message, self.time_s)
        if autopilot_s is not None:
            self._silence.receive(time.monotonic())
            self._pass(autopilot_s)
            self._estimator.yaw_rad = message.yaw
        self._setup.receive(message, time.monotonic())
        begins = self._tracker.home is None
        if self._tracker.receive(message, self._clock.autopilot_s(self.time_s)) and begins:
            self.record = TruthRecord(self._tracker.state)

    def _pass(self, time_s: float) -> None:
        """Advance to `time_s` in steps of 10 ms."""
        while self.time_s < time_s - 1e-9:
            self._steps += 1
            self._step()

    def _step(self) -> None:
        """Advance by one step, and send the messages that are due."""
        state = self._tracker.at(self.time_s)
        self._history.add(state)
        self._estimator.update(state)
        notable_m = self.record.notable_m
        if self.record.observe(
            state, self._model.body_clearance_m(state.position_ned_m, notable_m)
        ):
            self._crash()
        for message in self._due():
            self._transport.send(message)

    def _due(self) -> list[Message]:
        if self._tracker.home is None or not self._setup.firmware:
            return []
        messages, truth = [], self._history.at(self.time_s)
        if self._steps % ODOMETRY_STEPS == 0:
            messages.append(odometry(self._setup.firmware, self._estimator, truth))
        if self._steps % DISTANCE_STEPS == 0:
            messages += distances(truth, self._model.range_m, self._noise)
        return messages

    def _crash(self) -> None:
        """Stop the motors by force after a collision."""
        self._report("crash: hit an obstacle")
        if self._setup.target is not None:
            command = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
            self._transport.send(command_long(self._setup.target, command, (0, FORCE_DISARM)))


def _heartbeat() -> Message:
    """HEARTBEAT (0) of visual inertial odometry."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_AUTOPILOT_INVALID,
        *(0, 0),
        mavlink.MAV_STATE_ACTIVE,
        3,
    )
