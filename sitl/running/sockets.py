"""Opens the transports and bus ports of the served vehicles."""

from collections.abc import Callable, Sequence
from pathlib import Path

from companion.link.signing import Signing, read_key
from companion.link.transports.transport import AUTOPILOT_COMPONENT, UdpTransport
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.external.vehicle import COMPONENT, ExternalVehicle
from sitl.running.server import Endpoint, listen
from sitl.simulation.fleet import Fleet
from sitl.simulation.simulation import Setup

ANY_PORT = 0
"""Port number with which the operating system chooses a free port."""


def fleet_endpoints(
    setups: Sequence[Setup],
    watch: ParameterWatch,
    mavlink: Sequence[str],
    bus_port: int,
    *,
    signing_key: Path | None = None,
) -> tuple[Fleet, list[Endpoint]]:
    """Emulated vehicles with their endpoints; port numbers increase by one per vehicle.

    Raises:
        SitlError, LinkError: a port or address cannot be used.
    """
    transports = [
        [
            UdpTransport(
                port_after(url, number),
                each.system_id,
                AUTOPILOT_COMPONENT,
                Signing(read_key(signing_key)) if signing_key else None,
            )
            for url in mavlink
        ]
        for number, each in enumerate(setups)
    ]
    fleet = Fleet(setups, transports, watch)
    endpoints = [
        Endpoint(vehicle.board.bus, listen(bus_port + number if bus_port else ANY_PORT), links)
        for number, (vehicle, links) in enumerate(zip(fleet.vehicles, transports, strict=True))
    ]
    return fleet, endpoints


def external_endpoint(
    setup: Setup, connect: str, bus_port: int, report: Callable[[str], None]
) -> tuple[ExternalVehicle, Endpoint, str]:
    """An external autopilot in a simulated world, its endpoint, and the address of its MAVLink.

    Its companion has its own link.

    Raises:
        SitlError, LinkError: a port or address cannot be used.
    """
    transport = UdpTransport(connect, setup.system_id, COMPONENT)
    vehicle = ExternalVehicle(setup, transport, report)
    return vehicle, Endpoint(vehicle.board.bus, listen(bus_port), ()), transport.address


def port_after(url: str, number: int) -> str:
    """The address with a higher port; port 0 stays."""
    start, _, port = url.rpartition(":")
    return f"{start}:{int(port) + number}" if port.isdecimal() and port != "0" else url
