"""A vehicle whose flight is simulated elsewhere, in our world, by the wall clock."""

import time
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.requests import command_long
from companion.link.transport import UdpTransport
from sitl.autopilot.estimator import REFERENCE_NOISE, Estimator
from sitl.autopilot.protocol import FORCE_DISARM
from sitl.autopilot.streams import Message
from sitl.external.feed import distances, vision
from sitl.external.setup import ExternalSetup
from sitl.external.tracker import TruthTracker
from sitl.noise import stream
from sitl.record import TruthRecord
from sitl.sensors.board import SensorBoard
from sitl.simulation import Setup, start_state
from sitl.truth import History
from sitl.vehicle import STEP_S
from sitl.world.model import WorldModel

COMPONENT: int = mavlink.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
VISION_STEPS, DISTANCE_STEPS, HEARTBEAT_STEPS = 2, 10, 100
"""50, 10 and 1 Hz."""


class ExternalVehicle:
    """Served like a `Simulation`, but `advance` waits: an autopilot elsewhere has its own time.

    `speed` is how many times faster than real time it simulates.
    """

    def __init__(
        self, setup: Setup, transport: UdpTransport, speed: float, tell: Callable[[str], None]
    ) -> None:
        start = start_state(setup)
        self._transport = transport
        self._model = WorldModel(setup.world)
        self._tracker = TruthTracker(start)
        self._setup = ExternalSetup(tell)
        self._tell = tell
        self._estimator = Estimator(start, setup.seed, REFERENCE_NOISE)
        self._noise = stream(setup.seed, "range sensors of the autopilot")
        self._history = History(start)
        self._steps = 0
        self._speed = speed
        self._began_s = time.monotonic()
        self.record = TruthRecord(start)
        self.board = SensorBoard(
            setup.seed, setup.sensors, lambda beam: self._model.range_m, self._history.at
        )

    @property
    def time_s(self) -> float:
        return self._steps * STEP_S

    def advance(self, time_s: float) -> None:
        """Let the wall clock come to `time_s`, step by step."""
        while self.time_s < time_s - 1e-9:
            due_s = self._began_s + (self.time_s + STEP_S) / self._speed
            time.sleep(max(0.0, due_s - time.monotonic()))
            self._steps += 1
            self._step()
        self.board.bus.set_time(self.time_s)

    def _step(self) -> None:
        """10 ms: hear, move, feed."""
        for message in self._transport.receive():
            self._hear(message)
        state = self._tracker.at(self.time_s)
        self._history.add(state)
        self._estimator.update(state)
        if self.record.observe(state, self._model.body_clearance_m(state.position_ned_m)):
            self._crash()
        for message in self._due():
            self._transport.send(message)

    def _hear(self, message: Message) -> None:
        is_autopilot = message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
        if not is_autopilot:
            return
        self._setup.hear(message, self.time_s)
        self._tracker.hear(message, self.time_s)
        if message.get_type() == "ATTITUDE":
            self._estimator.yaw_rad = message.yaw

    def _due(self) -> list[Message]:
        messages = self._setup.requests(self.time_s, self._tracker.home)
        if self._steps % HEARTBEAT_STEPS == 0:
            messages.append(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
                    mavlink.MAV_AUTOPILOT_INVALID,
                    *(0, 0),
                    mavlink.MAV_STATE_ACTIVE,
                    3,
                )
            )
        if self._tracker.home is None:
            return messages
        if self._steps % VISION_STEPS == 0:
            messages += vision(self._estimator, self._history.at(self.time_s))
        if self._steps % DISTANCE_STEPS == 0:
            truth = self._history.at(self.time_s)
            messages += distances(truth, self._model.range_m, self._noise)
        return messages

    def _crash(self) -> None:
        """It has hit something: its motors are stopped by force."""
        self._tell("crash: hit an obstacle")
        if self._setup.target is not None:
            command = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
            self._transport.send(command_long(self._setup.target, command, (0, FORCE_DISARM)))
