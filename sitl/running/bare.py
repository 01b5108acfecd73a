"""`sitl autopilot`: runs an emulated autopilot alone, in real time, on an endless field.

It sends its true state, as simulated autopilots do, and another simulator provides its world. It
stands in for ArduPilot SITL and PX4 SIH.
"""

import signal
from collections.abc import Callable, Sequence
from pathlib import Path

from companion.link.transports.transport import AUTOPILOT_COMPONENT, UdpTransport
from sitl.autopilot.core import Autopilot
from sitl.core.truth import TrueState
from sitl.core.vehicle import STEP_S
from sitl.running.options import read_parameters
from sitl.running.server import Pace

MAX_BEHIND_S = 0.1
"""Wall time that the simulation catches up, s. A slower machine flies slower, without jumps."""
ON_THE_FIELD = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
"""True state at the start."""


def fly_bare(
    firmware: str,
    seed: int,
    mavlink: Sequence[str],
    *,
    parameter_file: Path | None,
    assignments: Sequence[str],
    speed: float,
    report: Callable[[str], None],
) -> None:
    """Run until interrupted; `report` prints a line.

    Raises:
        SitlError, LinkError: a parameter or address is invalid.
    """
    values, watch = read_parameters(firmware, parameter_file, assignments)
    vehicle = Autopilot(
        seed,
        ON_THE_FIELD,
        firmware=firmware,
        parameters=values,
        watch=watch,
        links=len(mavlink),
        sends_truth=True,
    )
    transports = [UdpTransport(url, vehicle.system_id, AUTOPILOT_COMPONENT) for url in mavlink]
    for transport in transports:
        report(f"MAVLink  {transport.address}")
    running = True

    def stop(*_: object) -> None:
        nonlocal running
        running = False

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    pace = Pace(speed)
    while running:
        pace.hold_back(vehicle.time_s + STEP_S)
        _step(vehicle, transports)
        if pace.due_s() - vehicle.time_s > MAX_BEHIND_S * speed:
            pace.resume(vehicle.time_s)


def _step(vehicle: Autopilot, transports: Sequence[UdpTransport]) -> None:
    for link, transport in enumerate(transports):
        for message in transport.receive():
            vehicle.receive(message, link)
    vehicle.step()
    for link, transport in enumerate(transports):
        for message in vehicle.take_outbox(link):
            transport.send(message)
