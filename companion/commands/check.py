"""Checks every part of the drone and shows the results live: `companion check`."""

from collections.abc import Sequence
from typing import Annotated

import typer
from rich.console import Console
from rich.live import Live

from companion.bringup.findings import CheckResult, Finding, table
from companion.bringup.hand_test import ask_for_hands
from companion.bringup.self_test import Examination
from companion.commands.options import BusUrl, ConfigFile, LinkUrl, Profile, load_settings
from companion.drivers.wires.opening import open_bus
from companion.link.transports.open_link import open_transport
from companion.run.clocks import open_clock
from companion.safety.health.lateness import TICK_S

EXIT_NOT_READY = 1
"""Exit status if a part is not good. Chosen."""


commands = typer.Typer()


@commands.command()
def check(
    config: ConfigFile = None,
    link: LinkUrl = None,
    bus: BusUrl = None,
    profile: Profile = None,
    seconds: Annotated[float, typer.Option(help="Duration of the check, s.", min=1)] = 10.0,
    hands: Annotated[
        bool,
        typer.Option(help="Then ask for a hand before each sensor, to detect swapped sensors."),
    ] = False,
) -> None:
    """Show every sensor, the gyro, the link and the autopilot; exit status 0 if all are good."""
    settings = load_settings(config, link, bus, profile)
    console = Console(highlight=False)
    transport = open_transport(settings.link, console.print)
    wires = open_bus(settings.sensors.bus)
    needs_pilot = settings.preflight.transmitter and not settings.sensors.is_simulated
    examination = Examination(settings, transport, wires, needs_pilot=needs_pilot)
    clock = open_clock(settings, transport, console.print)
    now_s = clock.wait_until(0.0)
    end_s = now_s + seconds
    findings: Sequence[Finding] = ()
    live = Live(console=console, refresh_per_second=8, transient=True)
    with live:
        while now_s < end_s:
            findings = examination.step(now_s)
            if console.is_terminal:
                live.update(table(findings))
            now_s = clock.wait_until(now_s + TICK_S)
    console.print(table(findings))
    swapped = hands and ask_for_hands(examination, clock, console)
    good = not swapped and all(finding.verdict is CheckResult.GOOD for finding in findings)
    raise typer.Exit(0 if good else EXIT_NOT_READY)
