"""Advances the simulated world: autopilot and vehicle, walls, sensors, ground truth.

    companion ──MAVLink──► autopilot ─► vehicle ─► true state ─► clearance, record
        ▲                      │                       │
        ├──────MAVLink─────────┘                       ▼
        └──────I2C──────── sensor board ◄──── ranges in the FCL world

Only `advance` makes time pass. Real time, faster than real time and lockstep differ in its caller.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from companion.config.range_sensors import SharpOnAds1115, SharpOnMcp3008
from companion.config.settings import SensorsConfig
from companion.core.frames import Vector3
from companion.core.messages import Beam
from companion.link.transports.transport import Message, Transport
from sitl.autopilot.core import FIRMWARES, FLIGHT_BATTERY_S, Autopilot, keep_nothing
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE, OdometryNoise
from sitl.autopilot.firmware import boot_values, system_id
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.core.noise import stream
from sitl.core.radio import LinkErrors, Radio
from sitl.core.truth import History, TrueState
from sitl.sensors.beam import RAY, BeamPhysics, LightBeam, RangeQuery
from sitl.sensors.board import SensorBoard
from sitl.simulation.record import TruthRecord
from sitl.simulation.starvation import Starvation
from sitl.simulation.traffic import (
    Others,
    clearance_to_others_m,
    no_others,
    with_crosstalk,
    with_others,
)
from sitl.world.format import World
from sitl.world.geometry.model import WorldModel


@dataclass(frozen=True, slots=True)
class Setup:
    """All inputs of a simulated flight; the same setup gives the same flight, bit for bit."""

    world: World
    world_name: str
    """Argument of `load_world`: a built-in world or a file."""
    seed: int
    sensors: SensorsConfig
    autopilot: str = "ardupilot"
    """ "ardupilot" or "px4"."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Autopilot parameters set before the start; others keep the vehicle's configuration."""
    beam: BeamPhysics = RAY
    """Beam physics of every range sensor."""
    start: int = 0
    """Number of the world's start pose."""
    odometry_noise: OdometryNoise = REFERENCE_NOISE
    range_gain_sigma: float | None = None
    """Standard deviation of the range sensors' gains; None: from the sensor's physics."""
    battery_s: float = FLIGHT_BATTERY_S
    """Flight time of a full battery, s."""

    @property
    def system_id(self) -> int:
        """The vehicle's MAVLink system id.

        Raises:
            ParameterError: the autopilot has no such parameter.
        """
        firmware = FIRMWARES[self.autopilot]()
        return system_id(firmware, boot_values(firmware, self.parameters))


class Simulation:
    """One vehicle in one world.

    `transports` are its links, the companion's first. `watch` is called for each parameter that a
    client sets. `others` returns the states of other vehicles.
    """

    def __init__(
        self,
        setup: Setup,
        transports: Sequence[Transport],
        watch: ParameterWatch = keep_nothing,
        others: Others = no_others,
    ) -> None:
        self._transports = transports
        self._radios: list[tuple[Radio[Message], Radio[Message]]] = [
            (Radio(stream(setup.seed, f"uplink {link}")), Radio(stream(setup.seed, f"link {link}")))
            for link in range(len(transports))
        ]
        """Both directions of each link: to the vehicle, and from it."""
        self.companion_hangs_until_s = 0.0
        """A fault for tests: the companion stops until this time, s."""
        self.starvation = Starvation(stream(setup.seed, "starved computer"))
        self._setup = setup
        self._others = others
        self.bystanders: list[Vector3] = []
        """People, for tests: bodies as large as a drone's, world NED, m."""
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
        """Process received messages, then let time pass until `time_s`."""
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

    def disturb_link(self, errors: LinkErrors) -> None:
        """A fault for tests: disturb MAVLink in both directions."""
        for to_vehicle, from_vehicle in self._radios:
            to_vehicle.errors = from_vehicle.errors = errors

    def _observe(self, state: TrueState) -> None:
        self._history.add(state)
        clearance_m = self._model.body_clearance_m(state.position_ned_m, self.record.notable_m)
        if others := self._everybody():
            to_others_m = clearance_to_others_m(state.position_ned_m, others)
            clearance_m = min(clearance_m, to_others_m)
        if self.record.observe(state, clearance_m):
            self.autopilot.crash("hit an obstacle")

    def _everybody(self) -> Sequence[Vector3]:
        return [*(other.position_ned_m for other in self._others()), *self.bystanders]

    def _range_query(self, beam: Beam) -> RangeQuery:
        """Ranges to walls and to other bodies."""
        query = with_others(beam_query(self._setup, self._model, beam), self._everybody)
        if not isinstance(self._setup.sensors.beams[beam], SharpOnAds1115 | SharpOnMcp3008):
            return query
        random = stream(self._setup.seed, f"crosstalk {beam.value}")
        return with_crosstalk(query, self._others, random)


def beam_query(setup: Setup, model: WorldModel, beam: Beam) -> RangeQuery:
    """The ranging function of a beam: a plain ray, which is fastest, unless physics is set."""
    if setup.beam == RAY:
        return model.range_m
    return LightBeam(setup.beam, model.hits, setup.seed, beam.value).range_m


def start_state(setup: Setup) -> TrueState:
    """The state on the floor at a start pose; the seed draws a heading that is not given."""
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
