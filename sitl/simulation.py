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
from dataclasses import dataclass

from companion.config import SensorsConfig
from companion.link.transport import Transport
from companion.messages import Beam
from sitl.autopilot.core import Autopilot
from sitl.noise import stream
from sitl.record import TruthRecord
from sitl.sensors.beam import RAY, BeamPhysics, LightBeam, RangeQuery
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
    beam: BeamPhysics = RAY
    """Of every range sensor."""


class Simulation:
    """One vehicle in one world."""

    def __init__(self, setup: Setup, transport: Transport) -> None:
        self._transport = transport
        self.is_link_down = False
        """A fault for tests: MAVLink is lost in both directions."""
        self._setup = setup
        self._model = WorldModel(setup.world)
        start = start_state(setup)
        self.autopilot = Autopilot(setup.seed, start, personality=setup.autopilot)
        self._history = deque([start], maxlen=HISTORY_STEPS)
        self.record = TruthRecord(start)
        self.board = SensorBoard(setup.seed, setup.sensors, self._range_query, self._truth_at)

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

    def _range_query(self, beam: Beam) -> RangeQuery:
        """A plain ray, the quickest there is, unless more was asked for."""
        if self._setup.beam == RAY:
            return self._model.range_m
        return LightBeam(self._setup.beam, self._model.hits, self._setup.seed, beam.value).range_m

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
