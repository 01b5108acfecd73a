"""`sitl bench`: figures that can be checked."""

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from sitl.options import Autopilot, FlightOptions, Profile, Seed

commands = typer.Typer(no_args_is_help=True, help="Measure the simulator and the companion.")


@commands.callback()
def _several_commands() -> None:
    """Keep each benchmark a command of its own."""


@commands.command()
def speed(
    world: Annotated[str, typer.Option(help="A built-in world, or a world file.")] = "room_200",
    seed: Seed = 1,
    profile: Profile = "gp2y0a710k0f",
    runs: Annotated[int, typer.Option(help="Flights on each transport; medians count.")] = 3,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object.")] = False,
) -> None:
    """A whole mission on every transport: how many times faster than real time, on one core."""
    from sitl.bench.speed import TRANSPORTS, measure, on_one_core  # noqa: PLC0415 - slow to load

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


@commands.command()
def accuracy(
    seeds: Annotated[int, typer.Option(help="Flights of each world, seeds 1 to N.", min=1)] = 30,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object.")] = False,
) -> None:
    """Maps and trajectories against the truth, dead reckoning and an ideal solver beside them."""
    from sitl.bench.accuracy import fly_all, setups, summary  # noqa: PLC0415 - slow to load
    from sitl.bench.accuracy_table import accuracy_tables  # noqa: PLC0415

    flights = setups(seeds)
    progress = Console(stderr=True)
    results = list(track(fly_all(flights), "flying", len(flights), console=progress))
    rows = summary(results)
    if as_json:
        print(json.dumps({"seeds": seeds, "rows": rows}, indent=1))
        return
    Console(highlight=False).print(*accuracy_tables(rows), sep="\n")
