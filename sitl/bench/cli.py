"""`sitl bench`: figures that can be checked."""

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from sitl.bench.speed import TRANSPORTS, measure, on_one_core
from sitl.options import Autopilot, FlightOptions, Profile, Seed

commands = typer.Typer(no_args_is_help=True, help="Measure the simulator and the companion.")


@commands.callback()
def _several_commands() -> None:
    """Keep each benchmark a command of its own."""


@commands.command()
def speed(
    world: Annotated[
        str, typer.Option(help="A built-in world, random_SEED, or a world file.")
    ] = "room_200",
    seed: Seed = 1,
    profile: Profile = "gp2y0a710k0f",
    runs: Annotated[int, typer.Option(help="Flights on each transport; medians count.")] = 3,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object.")] = False,
) -> None:
    """A whole mission on every transport: how many times faster than real time, on one core."""
    on_one_core()
    options = FlightOptions(world, seed, profile, Autopilot.ARDUPILOT)
    results = [measure(options, transport, runs) for transport in TRANSPORTS]
    identical = len({result.poses for result in results}) == 1
    if as_json:
        rows = [asdict(result) for result in results]
        print(json.dumps({"world": world, "identical": identical, "transports": rows}, indent=1))
        return
    table = Table("transport", "flight, s", "waited, s", "× real time")
    for result in results:
        table.add_row(
            result.transport,
            f"{result.flight_s:.1f}",
            f"{result.waited_s:.2f}",
            f"{result.speed:.1f}",
        )
    console = Console(highlight=False)
    console.print(table)
    console.print("poses identical to the bit" if identical else "POSES DIFFER")
