"""Resumes control of a flying drone after a crash of this program: `companion recover`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.commands.options import BusUrl, ConfigFile, LinkUrl, Profile, load_settings
from companion.config.settings import Config
from companion.core.errors import CompanionError, ConfigError
from companion.core.messages import RangeScan, VehicleState, is_ours
from companion.core.printed import flight_console
from companion.drivers.models import range_models
from companion.link.link import Link
from companion.link.reports import Reports
from companion.link.transports.open_link import open_transport
from companion.recording.crashed import find_crashed
from companion.run.clocks import Clock, open_clock

EXIT_FAILED = 1
"""Exit status after which systemd restarts the program; it does not restart after status 2."""
TICK_S = 0.05
"""Time between polls of the link, s. Chosen."""
LISTEN_S = 8.0
"""Longest wait for the vehicle's mode, s. Chosen."""

commands = typer.Typer()


@commands.command("recover")
def recover_command(
    config: ConfigFile = None,
    link: LinkUrl = None,
    bus: BusUrl = None,
    profile: Profile = None,
    out: Annotated[Path, typer.Option(help="Folder of the flight's recording.")] = Path("out"),
) -> None:
    """After a crash in flight, land or continue as set by mission.after_crash; never take off."""
    with flight_console() as console:
        try:
            code = _recover(load_settings(config, link, bus, profile), out, console)
        except CompanionError as error:
            if not _may_pass(error):
                raise
            console.print(f"companion: {error}", soft_wrap=True)
            code = EXIT_FAILED
    raise typer.Exit(code)


def _may_pass(error: CompanionError) -> bool:
    """Test whether a retry may succeed: not after a configuration error, unless from the OS."""
    return not isinstance(error, ConfigError) or isinstance(error.__cause__, OSError)


def _recover(settings: Config, out: Path, console: Console) -> int:
    crashed = find_crashed(out)
    transport = open_transport(settings.link, console.print, in_the_air=True)
    clock = open_clock(settings, transport, console.print)
    vehicle = listen(
        Link(transport, settings.link),
        Reports(settings.link, range_models(settings.sensors)),
        clock,
        crashed.words() if crashed else "back after a crash",
    )
    console.print(f"the drone is {'armed' if vehicle.armed else 'not armed'} in {vehicle.mode}")
    from companion.run.resume import Recovery  # noqa: PLC0415 - slow to load

    recovery = Recovery(settings, transport, clock, crashed=crashed, out=out, console=console)
    return recovery.take_up() if is_ours(vehicle) else recovery.map_only()


def listen(link: Link, reports: Reports, clock: Clock, words: str) -> VehicleState:
    """Wait for the vehicle's mode, at most `LISTEN_S`, and return the vehicle's state.

    Sends heartbeats from the first message of the vehicle, and status reports once it has a mode.
    """
    now_s = clock.wait_until(0.0)
    end_s = now_s + LISTEN_S
    while True:
        vehicle = link.poll(now_s).vehicle
        if vehicle.connected or vehicle.silent_s < LISTEN_S:
            link.send(now_s, None, None)
        if vehicle.mode:
            link.transmit(reports.due(now_s, RangeScan(now_s, {}), words, ""))
        if vehicle.mode or now_s > end_s:
            return vehicle
        now_s = clock.wait_until(now_s + TICK_S)
