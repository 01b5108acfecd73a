"""How many times faster than real time a whole mission is flown, on each transport.

One core for all processes of a flight. `speed` counts from the first to the last moment of the
flight, the map at its end included; starting the processes comes on top, in `waited_s`.
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


@dataclass(frozen=True, slots=True)
class Speed:
    """One transport's figures: medians over the runs."""

    transport: str
    flight_s: float
    """Simulated."""
    waited_s: float
    """On the wall clock."""
    speed: float
    poses: str
    """Digest of every true pose: equal where flights are equal to the bit."""


def on_one_core() -> None:
    """Keep this process and its children to one core, where the system can."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def measure(options: FlightOptions, transport: str, runs: int) -> Speed:
    """Fly the same mission some times."""
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
