"""The world at one moment, and how it moves on: autopilot and vehicle, walls, sensors, truth.

    companion ──MAVLink──► autopilot ─► vehicle ─► true state ─► clearance, record
        ▲                      │                       │
        ├──────MAVLink─────────┘                       ▼
        └──────I2C──────── sensor board ◄──── ranges in the FCL world

`advance` is the only way time passes; real time, faster than real time and lockstep differ in who
calls it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from companion.config.settings import SensorsConfig
from companion.core.frames import Vector3
from companion.core.messages import Beam
from companion.link.transports.transport import Transport
from sitl.autopilot.core import FIRMWARES, FLIGHT_BATTERY_S, Autopilot, keep_nothing
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE, OdometryNoise
from sitl.autopilot.firmware import boot_values, system_id
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.core.noise import stream
from sitl.core.radio import Radio, Troubles
from sitl.core.truth import History, TrueState
from sitl.sensors.beam import RAY, BeamPhysics, LightBeam, RangeQuery
from sitl.sensors.board import SensorBoard
from sitl.simulation.record import TruthRecord
from sitl.simulation.starvation import Starvation
from sitl.simulation.traffic import Others, clearance_to_others_m, nobody, with_others
from sitl.world.format import World
from sitl.world.geometry.model import WorldModel


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
    beam: BeamPhysics = RAY
    """Of every range sensor."""
    start: int = 0
    """Which of the world's start poses."""
    odometry_noise: OdometryNoise = REFERENCE_NOISE
    range_gain_sigma: float | None = None
    """Spread of the range units' gains; None: as the sensor's physics has it."""
    battery_s: float = FLIGHT_BATTERY_S
    """How long a full battery flies."""

    @property
    def system_id(self) -> int:
        """The MAVLink system that the vehicle will be.

        Raises:
            ParameterError: a parameter that the autopilot does not have.
        """
        firmware = FIRMWARES[self.autopilot]()
        return system_id(firmware, boot_values(firmware, self.parameters))


class Simulation:
    """One vehicle in one world.

    `transports` are its links, the companion's first; `watch` is told the parameters that a client
    sets; `others` tells where other vehicles are.
    """

    def __init__(
        self,
        setup: Setup,
        transports: Sequence[Transport],
        watch: ParameterWatch = keep_nothing,
        others: Others = nobody,
    ) -> None:
        self._transports = transports
        self._radios = [
            (Radio(stream(setup.seed, f"uplink {link}")), Radio(stream(setup.seed, f"link {link}")))
            for link in range(len(transports))
        ]
        """Of each link, to the vehicle and from it."""
        self.companion_hangs_until_s = 0.0
        """A fault for tests: until then the companion does nothing."""
        self.starvation = Starvation(stream(setup.seed, "starved computer"))
        self._setup = setup
        self._others = others
        self.bystanders: list[Vector3] = []
        """People who stand about, for tests: bodies as large as a drone's, world NED, metres."""
        self._model = WorldModel(setup.world)
        start = start_state(setup)
        self.autopilot = Autopilot(
            setup.seed,
            start,
            firmware=setup.autopilot,
            parameters=setup.parameters,
            watch=watch,
            links=len(transports),
            noise=setup.odometry_noise,
            battery_s=setup.battery_s,
        )
        self._history = History(start)
        self.record = TruthRecord(start)
        self.board = SensorBoard(
            setup.seed,
            setup.sensors,
            self._range_query,
            self._history.at,
            gain_sigma=setup.range_gain_sigma,
        )
        self.autopilot.connect(self.board.from_autopilot)

    @property
    def time_s(self) -> float:
        return self.autopilot.time_s

    def advance(self, time_s: float) -> None:
        """Take in what has been sent to it, and let time pass until `time_s`."""
        for link, transport in enumerate(self._transports):
            for message in self._radios[link][0].carry(transport.receive(), self.time_s):
                self.autopilot.receive(message, link)
        while self.autopilot.time_s < time_s - 1e-9:
            self.autopilot.step()
            self._observe(self.autopilot.truth)
            for link, transport in enumerate(self._transports):
                outbox = self.autopilot.take_outbox(link)
                for message in self._radios[link][1].carry(outbox, self.time_s):
                    transport.send(message)
        self.board.bus.set_time(self.autopilot.time_s)

    def disturb_link(self, troubles: Troubles) -> None:
        """A fault for tests: MAVLink suffers in both directions."""
        for to_vehicle, from_vehicle in self._radios:
            to_vehicle.troubles = from_vehicle.troubles = troubles

    def _observe(self, state: TrueState) -> None:
        self._history.add(state)
        clearance_m = self._model.body_clearance_m(state.position_ned_m)
        if others := self._everybody():
            to_others_m = clearance_to_others_m(state.position_ned_m, others)
            clearance_m = min(clearance_m, to_others_m)
        if self.record.observe(state, clearance_m):
            self.autopilot.crash("hit an obstacle")

    def _everybody(self) -> Sequence[Vector3]:
        return [*self._others(), *self.bystanders]

    def _range_query(self, beam: Beam) -> RangeQuery:
        """Walls, and whoever else is there."""
        return with_others(beam_query(self._setup, self._model, beam), self._everybody)


def beam_query(setup: Setup, model: WorldModel, beam: Beam) -> RangeQuery:
    """How far a beam reaches: a plain ray, the quickest there is, unless more was asked for."""
    if setup.beam == RAY:
        return model.range_m
    return LightBeam(setup.beam, model.hits, setup.seed, beam.value).range_m


def start_state(setup: Setup) -> TrueState:
    """On the floor at one of the world's start poses; an open heading is drawn from the seed."""
    start = setup.world.starts[setup.start]
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
