"""Opens the link, sensors and clock of a flight as configured."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from companion.config.settings import Config
from companion.drivers.autopilot_gyro import AutopilotGyro
from companion.drivers.gyro import Gyro, calibrated, open_gyro
from companion.drivers.models import range_models
from companion.drivers.ranges import RangeSensors
from companion.drivers.wires.bus import Wires
from companion.drivers.wires.opening import open_bus
from companion.earlier import EarlierFlights
from companion.link.firmware import Fence
from companion.link.link import Link, Listener
from companion.link.link_budget import require_capacity
from companion.link.reports import Reports
from companion.link.transports.open_link import open_transport
from companion.link.transports.transport import Transport
from companion.recording.recorder import NOT_RECORDED, Recorder, open_recorder
from companion.recording.room import refuse_no_room
from companion.run.clocks import Clock, open_clock
from companion.run.loop import Rig
from companion.run.preflight.bus_time import refuse_slow_bus
from companion.run.preflight.rehearsed import refuse_unrehearsed
from companion.team.radio import NoRadio, TeamRadio
from companion.team.zenoh_radio import open_team_radio


@dataclass(frozen=True, slots=True)
class Sensors:
    """All sensors of a drone, and what of them receives the autopilot's messages."""

    ranges: RangeSensors
    gyro: Gyro
    listeners: tuple[Listener, ...]

    def sweep(self, now_s: float) -> None:
        """Read all sensors, as in a tick."""
        self.gyro.read(now_s)
        self.ranges.read(now_s)


def open_sensors(config: Config, wires: Wires) -> Sensors:
    """Open range sensors and gyro.

    Raises:
        SensorError: a sensor is missing or is of another type than configured.
    """
    ranges = RangeSensors(wires, config.sensors)
    gyro = open_gyro(wires, config.sensors)
    listeners: list[Listener] = []
    if ranges.from_autopilot is not None:
        listeners.append(ranges.from_autopilot)
    if isinstance(gyro, AutopilotGyro):
        listeners.append(gyro)
    return Sensors(ranges, calibrated(gyro, config.sensors), tuple(listeners))


def make_rig(
    config: Config,
    transport: Transport,
    wires: Wires,
    clock: Clock,
    radio: TeamRadio | None = None,
) -> Rig:
    """Create sensors, gyro and link; sensors of the autopilot receive their data from the link.

    Raises:
        SensorError: a sensor is missing or is of another type than configured.
    """
    return rig_of(config, transport, open_sensors(config, wires), clock, radio or NoRadio())


def rig_of(
    config: Config,
    transport: Transport,
    sensors: Sensors,
    clock: Clock,
    radio: TeamRadio,
    *,
    needs_pilot: bool = False,
) -> Rig:
    """Create the link of open sensors.

    `needs_pilot`: the vehicle is ready only while a pilot could take it over.
    """
    fence = fence_to_set(config)
    link = Link(transport, config.link, sensors.listeners, needs_pilot=needs_pilot, fence=fence)
    reports = Reports(config.link, range_models(config.sensors))
    return Rig(link, sensors.ranges, sensors.gyro, clock, reports, radio)


def fence_to_set(config: Config) -> Fence | None:
    """The fence that the autopilot gets; None if it keeps its own."""
    limits = Fence(config.mission.max_height_m, config.mission.max_distance_m)
    return limits if config.link.set_fence and limits != Fence(None, None) else None


@contextmanager
def open_rig(
    config: Config,
    out: Path | None,
    warn: Callable[[str], None],
    earlier: EarlierFlights | None = None,
    *,
    skip_rehearsal: bool = False,
) -> Iterator[tuple[Rig, Recorder]]:
    """Open the configured hardware and a recording in `out`, which must have enough free space.

    A real drone needs what `[preflight]` says. `skip_rehearsal` flies it without a rehearsal.

    `earlier`: the map of earlier flights with which the flight begins, for the recording.

    Raises:
        CompanionError: the configuration, a device or the folder cannot be used.
    """
    require_capacity(config)
    if out is not None:
        refuse_no_room(out, config)
    transport = open_transport(config.link, warn)
    with (
        closing(transport),
        closing(open_bus(config.sensors.bus)) as wires,
        closing(open_clock(config, transport, warn)) as clock,
        open_team_radio(config.team) as radio,
    ):
        sensors = open_sensors(config, wires)
        is_real = not config.sensors.is_simulated
        if is_real and not skip_rehearsal:
            refuse_unrehearsed(config, transport, clock)
        if is_real:
            refuse_slow_bus(sensors.sweep, clock, config.sensors.bus)
        recorder: Recorder = NOT_RECORDED
        if out is not None:
            recorder = open_recorder(out, config, time.time(), warn, earlier=earlier)
        needs_pilot = is_real and config.preflight.transmitter
        link = recorder.tap(transport)
        yield rig_of(config, link, sensors, clock, radio, needs_pilot=needs_pilot), recorder
