"""The commands `sitl bench`: measurements of simulator and companion."""

import json
import signal
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.config.team import MAX_DRONES, TEAM_DRONES
from companion.core.errors import OutputError
from sitl.running.options import (
    Autopilot,
    Battery,
    ClutterSeed,
    Crop,
    FlightOptions,
    Profile,
    Seed,
)

if TYPE_CHECKING:
    from sitl.bench.missions import Flown
    from sitl.bench.summary import Summary
    from sitl.bench.surveys import SurveyFlown
    from sitl.bench.teams import TeamFlown
    from sitl.scoring.report import Report

commands = typer.Typer(no_args_is_help=True, help="Measure the simulator and the companion.")


@commands.callback()
def _end_as_by_ctrl_c() -> None:
    """Handle SIGTERM like Ctrl-C, so that the results so far are kept."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)


DEFAULT_PROFILE = "gp2y0a710k0f"
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]


@commands.command()
def speed(
    world: Annotated[
        str, typer.Option(help="A built-in world, random_SEED, or a world file.")
    ] = "room_200",
    seed: Seed = 1,
    profile: Profile = "gp2y0a710k0f",
    runs: Annotated[int, typer.Option(help="Flights per transport; the median counts.")] = 3,
    as_json: AsJson = False,
) -> None:
    """Measure a mission's speed on every transport, in times real time on one core."""
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
    console.print("poses bit-identical" if identical else "POSES DIFFER")


@commands.command()
def accuracy(
    seeds: Annotated[int, typer.Option(help="Flights per world, seeds 1 to N.", min=1)] = 30,
    as_json: AsJson = False,
) -> None:
    """Compare maps and trajectories with the truth, dead reckoning and an ideal solver."""
    from sitl.bench.accuracy import fly_all, setups, summary  # noqa: PLC0415 - slow to load
    from sitl.bench.tables.accuracy import accuracy_tables, lost_flights  # noqa: PLC0415

    rows = summary(fly_all(setups(seeds)))
    if as_json:
        print(json.dumps({"seeds": seeds, "rows": rows}, indent=1))
        return
    console = Console(highlight=False)
    console.print(*accuracy_tables(rows), sep="\n")
    for line in lost_flights(rows):
        console.print(line, soft_wrap=True, markup=False)


@commands.command()
def missions(
    worlds: Annotated[
        list[str] | None,
        typer.Option(
            help="paper (default), office, exterior, random, all; a folder of plans, each from "
            "up to three starts; or one world. Repeatable."
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Flights per start: seeds 1 to N.", min=1)] = 1,
    profile: Annotated[
        list[str] | None, typer.Option(help="Range sensors, default gp2y0a710k0f; repeatable.")
    ] = None,
    mission: Annotated[
        str | None,
        typer.Option(
            help="Kind of mission, or a mission file; by default it depends on the world."
        ),
    ] = None,
    autopilot: Annotated[Autopilot, typer.Option(help="Emulated firmware.")] = (
        Autopilot.ARDUPILOT
    ),
    crop: Crop = None,
    battery_s: Battery = None,
    clutter: Annotated[
        list[float] | None,
        typer.Option(help="Clutter in every world, 0 to 1; default 0. Repeatable.", min=0, max=1),
    ] = None,
    clutter_seed: ClutterSeed = None,
    as_json: AsJson = False,
    sheet: Annotated[Path | None, typer.Option(help="PNG of all plans and paths.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for missions.json, updated after each flight, and a sheet of all plans."
        ),
    ] = None,
) -> None:
    """Fly many missions on all cores; report how many are completed, and the scores.

    Exit status 1 if a flight has no result, such as in a plan that cannot be read.
    """
    from companion.export.map_files import each_by_itself, save_as  # noqa: PLC0415 - slow to load
    from sitl.bench.missions import fly_and_show  # noqa: PLC0415
    from sitl.bench.sets import jobs_for  # noqa: PLC0415
    from sitl.bench.sheet import draw_sheet  # noqa: PLC0415
    from sitl.bench.summary import show, sum_up  # noqa: PLC0415

    jobs = jobs_for(
        worlds or ["paper"],
        seeds,
        profile or [DEFAULT_PROFILE],
        mission,
        autopilot=autopilot,
        crop_m=crop,
        battery_s=battery_s,
        clutters=clutter or [0.0],
        clutter_seed=clutter_seed,
    )
    ended: list[Report] = []

    def keep(flown: "Flown") -> None:
        ended.append(flown.row)
        if out is not None:  # kept if interrupted; a full disk is no reason to stop
            with suppress(OutputError):
                save_as(_save_json, sum_up(ended), out / "missions.json")

    flights = fly_and_show(jobs, keep)
    result = sum_up([flown.row for flown in flights])
    if as_json:
        print(json.dumps(result, indent=1))
    else:
        show(result, Console(highlight=False))
    outputs: list[Callable[[], object]] = []
    if out is not None:
        outputs.append(partial(save_as, _save_json, result, out / "missions.json"))
    sheets = [path for path in (out and out / "missions.png", sheet) if path and flights]
    outputs += [partial(save_as, draw_sheet, flights, path) for path in sheets]
    each_by_itself(outputs)
    _exit_by_lost(result)


@commands.command()
def surveys(
    worlds: Annotated[
        list[str] | None,
        typer.Option(
            help="As for `bench missions`; one survey from the first start of each. Repeatable."
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Surveys of each world: seeds 1 to N.", min=1)] = 1,
    profile: Profile = DEFAULT_PROFILE,
    autopilot: Annotated[Autopilot, typer.Option(help="Emulated firmware.")] = (
        Autopilot.ARDUPILOT
    ),
    sorties: Annotated[int, typer.Option(help="Most sorties of a survey.", min=1)] = 6,
    drones: Annotated[
        int, typer.Option(help="Drones that fly together.", min=1, max=MAX_DRONES)
    ] = 1,
    battery_s: Battery = 600.0,
    crop: Crop = None,
    clutter: Annotated[float, typer.Option(help="Clutter in every world.", min=0, max=1)] = 0.0,
    single: Annotated[
        bool,
        typer.Option(help="Fly each world also in one flight, with the battery of all flights."),
    ] = False,
    as_json: AsJson = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for surveys.json, updated after each survey, and a sheet by flight."
        ),
    ] = None,
) -> None:
    """Fly surveys on all cores: several flights from one pad, with one joint map."""
    from companion.export.map_files import save_as  # noqa: PLC0415 - slow to load
    from sitl.bench.engine import with_a_bar  # noqa: PLC0415
    from sitl.bench.sets import from_first_starts, jobs_for  # noqa: PLC0415
    from sitl.bench.sheet import draw_sheet  # noqa: PLC0415
    from sitl.bench.surveys import SurveyJob, failed, fly, lost, sum_up, survey_table  # noqa: PLC0415

    flights = jobs_for(
        worlds or ["paper"],
        seeds,
        [profile],
        "building",
        autopilot=autopilot,
        crop_m=crop,
        battery_s=battery_s,
        clutters=[clutter],
    )
    jobs = [SurveyJob(job, sorties, single, drones) for job in from_first_starts(flights)]
    ended: list[SurveyFlown] = []

    def progress_text(flown: "SurveyFlown") -> str:
        ended.append(flown)
        if out is not None:  # kept if interrupted; a full disk is no reason to stop
            with suppress(OutputError):
                save_as(_save_json, sum_up(ended), out / "surveys.json")
                save_as(draw_sheet, [each.joint for each in ended], out / "surveys.png")
        row = flown.row
        return f"{row['world']}: {row.get('flights', 0)} flights, {row['ending']}"

    flown = with_a_bar(
        jobs, progress_text, fly, lost, has_failed=lambda flown: bool(flown.row["lost"])
    )
    result = sum_up(flown)
    if as_json:
        print(json.dumps(result, indent=1))
    else:
        console = Console(highlight=False)
        console.print(survey_table(result))
        for line in failed(flown):
            console.print(line, soft_wrap=True, markup=False)
    _exit_by_lost(result)


@commands.command()
def teams(
    worlds: Annotated[
        list[str] | None,
        typer.Option(
            help="As for `bench missions`; one team from the first start of each. Repeatable."
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Teams in each world: seeds 1 to N.", min=1)] = 1,
    profile: Profile = DEFAULT_PROFILE,
    autopilot: Annotated[Autopilot, typer.Option(help="Emulated firmware.")] = (
        Autopilot.ARDUPILOT
    ),
    mission: Annotated[str, typer.Option(help=f"Mission: {', '.join(TEAM_DRONES)}.")] = "building",
    drones: Annotated[int, typer.Option(help="Drones of a team.", min=2, max=MAX_DRONES)] = 2,
    battery_s: Battery = None,
    as_json: AsJson = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for teams.json, updated after each team, and a sheet."),
    ] = None,
) -> None:
    """Fly teams on all cores, and compare each with one drone in the same world."""
    from companion.export.map_files import save_as  # noqa: PLC0415 - slow to load
    from sitl.bench.engine import with_a_bar  # noqa: PLC0415
    from sitl.bench.sets import from_first_starts, jobs_for  # noqa: PLC0415
    from sitl.bench.sheet import draw_sheet  # noqa: PLC0415
    from sitl.bench.teams import TeamJob, fly, lost, sum_up, team_table  # noqa: PLC0415

    flights = jobs_for(
        worlds or ["paper"], seeds, [profile], mission, autopilot=autopilot, battery_s=battery_s
    )
    jobs = [TeamJob(job, drones) for job in from_first_starts(flights)]
    ended: list[TeamFlown] = []

    def progress_text(flown: "TeamFlown") -> str:
        ended.append(flown)
        if out is not None:  # kept if interrupted; a full disk is no reason to stop
            with suppress(OutputError):
                save_as(_save_json, sum_up(ended), out / "teams.json")
                save_as(draw_sheet, [each.joint for each in ended], out / "teams.png")
        return f"{flown.row['world']}: {flown.row['ending']}"

    teams = with_a_bar(
        jobs, progress_text, fly, lost, has_failed=lambda flown: bool(flown.row["lost"])
    )
    result = sum_up(teams)
    if as_json:
        print(json.dumps(result, indent=1))
    else:
        Console(highlight=False).print(team_table(result))
    _exit_by_lost(result)


def _exit_by_lost(result: "Summary") -> None:
    """End with status 1 if a flight has no result, such as in a world that cannot be read."""
    if result["totals"]["lost"]:
        raise typer.Exit(1)


def _save_json(result: "Summary", path: Path) -> None:
    path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


@commands.command()
def faults(
    flights: Annotated[int, typer.Option(help="Number of flights.", min=1)] = 500,
    seed: Annotated[int, typer.Option(help="Seed of the campaign.")] = 1,
    first: Annotated[int, typer.Option(help="Number of the first flight.", min=0)] = 0,
    as_json: AsJson = False,
) -> None:
    """Fly random flights with injected faults; check that each ends safely and keeps its map.

    Ctrl-C ends the campaign early and prints the results so far. Exit status 1 after any failure.
    """
    from sitl.bench.engine import with_a_bar  # noqa: PLC0415
    from sitl.bench.faults import FaultJob, fly, lost, sum_up  # noqa: PLC0415
    from sitl.bench.tables.faults import fault_table, progress_text  # noqa: PLC0415 - slow to load

    jobs = [FaultJob(seed, number) for number in range(first, first + flights)]
    rows = [flown.row for flown in with_a_bar(jobs, progress_text, fly, lost)]
    result = sum_up(seed, rows)
    if as_json:
        print(json.dumps(result, indent=1))
    else:
        Console(highlight=False).print(fault_table(result))
        for row in result["wrong"]:
            print(
                f"{row['number']}: {row['injected']}; {row['world']}, {row['profile']}, "
                f"{row['autopilot']}: {row['ending']}"
            )
    raise typer.Exit(1 if result["wrong"] else 0)
