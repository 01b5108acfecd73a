"""The world at one moment, and how it moves on: autopilot and vehicle, walls, sensors, truth.

    companion ──MAVLink──► autopilot ─► vehicle ─► true state ─► clearance, record
        ▲                      │                       │
        ├──────MAVLink─────────┘                       ▼
        └──────I2C──────── sensor board ◄──── ranges in the FCL world

`advance` is the only way time passes; real time, faster than real time and lockstep differ in who
calls it.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from companion.config import SensorsConfig
from companion.link.transport import Transport
from sitl.autopilot.core import PERSONALITIES, Autopilot, keep_nothing
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.autopilot.personality import boot_values, system_id
from sitl.noise import stream
from sitl.record import TruthRecord
from sitl.sensors.board import SensorBoard
from sitl.truth import TrueState
from sitl.world.format import World
from sitl.world.model import WorldModel

HISTORY_STEPS = 8
"""Enough for the slowest sensor, whose value may be 50 ms old."""


@dataclass(frozen=True, slots=True)
class Setup:
    """What defines a simulated flight; the same setup gives the same flight, to the bit."""

    world: World
    world_name: str
    """As `load_world` takes it: the name of a built-in world, or a file."""
    seed: int
    sensors: SensorsConfig
    autopilot: str = "ardupilot"
    """Or "px4"."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Of the autopilot, set before it starts; the others have the values of its configuration."""

    @property
    def system_id(self) -> int:
        """The MAVLink system that the vehicle will be.

        Raises:
            ParameterError: a parameter that the autopilot does not have.
        """
        personality = PERSONALITIES[self.autopilot]()
        return system_id(personality, boot_values(personality, self.parameters))


class Simulation:
    """One vehicle in one world; `watch` is told the parameters that a client sets."""

    def __init__(
        self, setup: Setup, transport: Transport, watch: ParameterWatch = keep_nothing
    ) -> None:
        self._transport = transport
        self.is_link_down = False
        """A fault for tests: MAVLink is lost in both directions."""
        self._model = WorldModel(setup.world)
        start = start_state(setup)
        self.autopilot = Autopilot(
            setup.seed,
            start,
            personality=setup.autopilot,
            parameters=setup.parameters,
            watch=watch,
        )
        self._history = deque([start], maxlen=HISTORY_STEPS)
        self.record = TruthRecord(start)
        self.board = SensorBoard(setup.seed, setup.sensors, self._model.range_m, self._truth_at)

    @property
    def time_s(self) -> float:
        return self.autopilot.time_s

    def advance(self, time_s: float) -> None:
        """Take in what the companion has sent, and let time pass until `time_s`."""
        for message in self._transport.receive():
            if not self.is_link_down:
                self.autopilot.receive(message)
        while self.autopilot.time_s < time_s - 1e-9:
            self.autopilot.step()
            self._observe(self.autopilot.truth)
            for message in self.autopilot.take_outbox():
                if not self.is_link_down:
                    self._transport.send(message)
        self.board.bus.set_time(self.autopilot.time_s)

    def _observe(self, state: TrueState) -> None:
        self._history.append(state)
        clearance_m = self._model.body_clearance_m(state.position_ned_m)
        if self.record.observe(state, clearance_m):
            self.autopilot.crash("hit an obstacle")

    def _truth_at(self, time_s: float) -> TrueState:
        """The newest state not later than `time_s`; the oldest kept if all are."""
        for state in reversed(self._history):
            if state.time_s <= time_s + 1e-9:
                return state
        return self._history[0]


def start_state(setup: Setup) -> TrueState:
    """On the floor at the world's first start pose; an open heading is drawn from the seed."""
    start = setup.world.starts[0]
    heading_rad = (
        stream(setup.seed, "start heading").uniform(-math.pi, math.pi)
        if start.heading_deg is None
        else math.radians(start.heading_deg)
    )
    return TrueState(
        time_s=0.0,
        position_ned_m=(*start.position, 0.0),
        velocity_ned_m_s=(0.0, 0.0, 0.0),
        roll_rad=0.0,
        pitch_rad=0.0,
        yaw_rad=heading_rad,
        yaw_rate_rad_s=0.0,
    )
