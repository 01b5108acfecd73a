"""Vehicles behind their doors: transports and bus ports for `run` to serve."""

from collections.abc import Callable, Sequence
from pathlib import Path

from companion.link.signing import Signing, read_key
from companion.link.transports.transport import AUTOPILOT_COMPONENT, UdpTransport
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.external.vehicle import COMPONENT, ExternalVehicle
from sitl.running.fleet import Fleet, fleet_setups
from sitl.running.server import Endpoint, listen
from sitl.simulation.simulation import Setup

ANY_PORT = 0


def fleet_doors(
    setup: Setup,
    watch: ParameterWatch,
    vehicles: int,
    mavlink: Sequence[str],
    bus_port: int,
    *,
    signing_key: Path | None = None,
) -> tuple[Fleet, list[Endpoint]]:
    """Emulated vehicles; each one's ports are one higher than the last one's.

    Raises:
        SitlError, LinkError: one line that says what to mend.
    """
    setups = fleet_setups(setup, vehicles)
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
    doors = [
        Endpoint(vehicle.board.bus, listen(bus_port + number if bus_port else ANY_PORT), links)
        for number, (vehicle, links) in enumerate(zip(fleet.vehicles, transports, strict=True))
    ]
    return fleet, doors


def external_door(
    setup: Setup, connect: str, bus_port: int, tell: Callable[[str], None]
) -> tuple[ExternalVehicle, Endpoint, str]:
    """Somebody else's autopilot in our world, and where its MAVLink is awaited.

    Its companion has a link of its own.

    Raises:
        SitlError, LinkError: one line that says what to mend.
    """
    transport = UdpTransport(connect, setup.system_id, COMPONENT)
    vehicle = ExternalVehicle(setup, transport, tell)
    return vehicle, Endpoint(vehicle.board.bus, listen(bus_port), ()), transport.address


def port_after(url: str, number: int) -> str:
    """The same address, some ports higher; port 0 stays any port."""
    start, _, port = url.rpartition(":")
    return f"{start}:{int(port) + number}" if port.isdecimal() and port != "0" else url
