"""Measures a mission's speed in times real time, on each transport.

All processes of a flight share one core. `speed` covers the flight including the final map.
`waited_s` also includes the start of the processes.
"""

import hashlib
import os
import statistics
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from companion.config import settings as configuration
from companion.config.settings import Config
from sitl.running.options import FlightOptions
from sitl.running.processes import fly_in_two_processes
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.record import TruthRecord

TRANSPORTS = ("direct", "bytes", "udp")
"""Message objects, encoded frames, and UDP between two processes."""


@dataclass(frozen=True, slots=True)
class Speed:
    """Figures of one transport: medians over the runs."""

    transport: str
    flight_s: float
    """Simulated time, s."""
    waited_s: float
    """Wall time, s."""
    speed: float
    poses: str
    """Digest of all true poses: equal for bit-identical flights."""


def on_one_core() -> None:
    """Bind this process and its children to one core, if the system supports it."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def measure(options: FlightOptions, transport: str, runs: int) -> Speed:
    """Fly the same mission `runs` times."""
    settings = configuration.load(None, {"sensors.profile": options.profile})
    fly = _fly_udp if transport == "udp" else _fly_in_process
    flights = [fly(options, settings, transport) for _ in range(runs)]
    record = flights[0][0]
    flight_s = record.path[-1].time_s
    flying_s = statistics.median(flying for _, flying, _ in flights)
    waited_s = statistics.median(waited for _, _, waited in flights)
    return Speed(transport, flight_s, waited_s, flight_s / flying_s, _digest(record))


def _fly_in_process(
    options: FlightOptions, settings: Config, transport: str
) -> tuple[TruthRecord, float, float]:
    setup, _ = options.setup()
    began_s = time.monotonic()
    app, simulation = fly_in_lockstep(setup, settings, lambda progress: None, transport)
    app.final_floor_plan()
    waited_s = time.monotonic() - began_s
    return simulation.record, waited_s, waited_s


def _fly_udp(
    options: FlightOptions, settings: Config, transport: str
) -> tuple[TruthRecord, float, float]:
    with tempfile.TemporaryDirectory() as folder:
        began_s = time.monotonic()
        flight = fly_in_two_processes(
            [*options.arguments(), "--speed=1000"], settings, Path(folder), quiet=True
        )
        return flight.truth, flight.flying_s, time.monotonic() - began_s


def _digest(record: TruthRecord) -> str:
    poses = repr([asdict(state) for state in record.path])
    return hashlib.sha256(poses.encode()).hexdigest()[:16]
