"""Implements the simulator's commands."""

import signal
from collections.abc import Callable
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.commands.options import Foxglove, MissionSet, WithFoxglove
from companion.commands.version import Version
from companion.config.settings import MISSION_KINDS, mission_settings
from companion.config.team import MAX_DRONES
from companion.core import terminal
from companion.core.errors import CompanionError
from companion.core.extras import needs_extra
from companion.export.map_files import each_by_itself, save
from sitl.bench.cli import commands as bench_commands
from sitl.campaign.cli import commands as campaign_commands
from sitl.commands.score import score
from sitl.core.errors import SitlError
from sitl.external.held_speed import HeldSpeed
from sitl.running.bare import fly_bare
from sitl.running.options import (
    Autopilot,
    Battery,
    BeamFile,
    Clutter,
    ClutterSeed,
    ConfigFile,
    Crop,
    FlightOptions,
    Param,
    Params,
    Profile,
    Seed,
    Start,
    WorldName,
)
from sitl.running.server import Endpoint, Server
from sitl.running.sockets import external_endpoint, fleet_endpoints
from sitl.simulation.fleet import fleet_setups
from sitl.simulation.record import TruthRecord, truth_files
from sitl.simulation.team_pads import pads_as_toml, setups_on_pads, team_pads
from sitl.view.cli import view
from sitl.world.cli import commands as world_commands
from sitl.world.format import WorldError

EXIT_NOT_COMPLETED = 1
"""Exit status of a mission that was not completed."""
EXIT_REFUSED = 2
"""Exit status of invalid options or files."""
DEFAULT_MAVLINK = "udpout:127.0.0.1:14550"
MAX_SPEED = 1000.0
"""Largest factor of real time."""
EMULATED_ONLY = (
    "--vehicles",
    "--team",
    "--mavlink",
    "--params",
    "--param",
    "--battery-s",
    "--lockstep",
)
"""Options that an external autopilot does not have."""

commands = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
commands.add_typer(world_commands, name="world")
commands.add_typer(bench_commands, name="bench")
commands.add_typer(campaign_commands, name="campaign")
commands.command()(view)
commands.command()(score)


@commands.callback()
def sitl(version: Version = False) -> None:
    """Simulate rooms, autopilot and sensors for the companion."""


class RunAutopilot(StrEnum):
    """An emulated firmware, or an external autopilot."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"
    EXTERNAL = "external"


class Transport(StrEnum):
    """Connection between companion and SITL."""

    DIRECT = "direct"
    BYTES = "bytes"
    UDP = "udp"


BusPort = Annotated[int, typer.Option(help="TCP port of the sensor bus; 0 for any.")]
Mavlink = Annotated[
    list[str] | None,
    typer.Option(help="udpin:HOST:PORT or udpout:HOST:PORT; repeatable, the companion's first."),
]
"""Port 14550 by default."""


@commands.command()
def run(
    world: WorldName,
    seed: Seed = 1,
    profile: Profile = "gp2y0a710k0f",
    autopilot: Annotated[
        RunAutopilot, typer.Option(help="Emulated firmware, or external: it simulates its flight.")
    ] = RunAutopilot.ARDUPILOT,
    start: Start = None,
    params: Params = None,
    param: Param = None,
    beam: BeamFile = None,
    crop: Crop = None,
    battery_s: Battery = None,
    clutter: Clutter = 0.0,
    clutter_seed: ClutterSeed = None,
    config: ConfigFile = None,
    vehicles: Annotated[
        int,
        typer.Option(help="Number of vehicles, each with link and bus on the next ports.", min=1),
    ] = 1,
    team: Annotated[
        int,
        typer.Option(help="Drones of a team, on pads beside the start.", min=1, max=MAX_DRONES),
    ] = 1,
    mavlink: Mavlink = None,
    signing_key: Annotated[
        Path | None,
        typer.Option(help="File with the MAVLink signing key; unsigned messages are rejected."),
    ] = None,
    connect: Annotated[
        str, typer.Option(help="External: its MAVLink address, udpin or udpout:HOST:PORT.")
    ] = "udpin:127.0.0.1:14551",
    bus_port: BusPort = 5790,
    speed: Annotated[
        float,
        typer.Option(
            help="Limit of the speed, times real time; not for external.", min=0.1, max=MAX_SPEED
        ),
    ] = 1.0,
    lockstep: Annotated[
        bool, typer.Option(help="Advance time only when every companion requests it.")
    ] = False,
    truth: Annotated[Path | None, typer.Option(help="File for the true flight, JSON.")] = None,
) -> None:
    """Serve vehicles in a world: MAVLink on UDP, sensors on TCP. Ctrl-C ends it."""
    print(f"world    {world}, seed {seed}, sensors {profile}, autopilot {autopilot.value}")
    external = autopilot is RunAutopilot.EXTERNAL
    if external:
        _reject_emulated_only(vehicles > 1, team > 1, mavlink, params, param, battery_s, lockstep)
    options = FlightOptions(
        world,
        seed,
        profile,
        Autopilot.ARDUPILOT.value if external else autopilot.value,
        start,
        params,
        param or (),
        beam,
        crop,
        config,
        battery_s,
        clutter,
        clutter_seed,
    )
    if external:
        _run_external(options, connect, bus_port, truth)
        return
    if vehicles > 1 and team > 1:
        raise SitlError("--vehicles and --team cannot be combined")
    setup, watch = options.setup()
    if team > 1:
        pads = team_pads(setup, options.settings({}).mission.height_m, team)
        print(f"team     {pads_as_toml(pads)}")
        setups = setups_on_pads(setup, pads)
    else:
        setups = fleet_setups(setup, vehicles)
    links = mavlink or [DEFAULT_MAVLINK]
    fleet, endpoints = fleet_endpoints(setups, watch, links, bus_port, signing_key=signing_key)
    for each, endpoint in zip(setups, endpoints, strict=True):
        _print_endpoint(endpoint, f"system {each.system_id}" if len(setups) > 1 else "")
    _serve(Server(fleet, endpoints, speed=speed, lockstep=lockstep))
    _save_truth([vehicle.record for vehicle in fleet.vehicles], truth)


def _reject_emulated_only(*given: object) -> None:
    """Reject options that an external autopilot does not have."""
    for name, value in zip(EMULATED_ONLY, given, strict=True):
        if value:
            raise SitlError(f"{name} is for emulated autopilots, not for an external one")


def _run_external(options: FlightOptions, connect: str, bus_port: int, truth: Path | None) -> None:
    vehicle, endpoint, address = external_endpoint(options.setup()[0], connect, bus_port, _say)
    print(f"MAVLink  {address}, for the simulator; give the companion a link of its own")
    print(f"sensors  sitl://127.0.0.1:{endpoint.bus_port}", flush=True)
    _serve(Server(vehicle, [endpoint], speed=MAX_SPEED, attendance=HeldSpeed(_say)))
    _save_truth([vehicle.record], truth)


def _say(text: str) -> None:
    print(text, flush=True)


def _print_endpoint(endpoint: Endpoint, whose: str) -> None:
    for transport in endpoint.transports:
        print(f"MAVLink  {transport.address}  {whose}".rstrip())
    print(f"sensors  sitl://127.0.0.1:{endpoint.bus_port}  {whose}".rstrip(), flush=True)


def _serve(server: Server) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: server.stop())
    server.serve()
    print(f"attended {server.attended_for_s:.3f} s", flush=True)


def _save_truth(records: list[TruthRecord], path: Path | None) -> None:
    """Write one file per vehicle."""
    if path is None:
        return
    paths = truth_files(path, len(records))
    each_by_itself(partial(record.save, to) for record, to in zip(records, paths, strict=True))


@commands.command()
def autopilot(
    autopilot: Autopilot = Autopilot.ARDUPILOT,
    seed: Seed = 1,
    params: Params = None,
    param: Param = None,
    mavlink: Mavlink = None,
    speed: Annotated[float, typer.Option(help="Speed, times real time.", min=0.1, max=100)] = 1.0,
) -> None:
    """Run an emulated autopilot alone on an endless field, with its true state. Ctrl-C ends it."""
    fly_bare(
        autopilot.value,
        seed,
        mavlink or [DEFAULT_MAVLINK],
        parameter_file=params,
        assignments=param or (),
        speed=speed,
        report=_say,
    )


@commands.command(cls=WithFoxglove)
def fly(
    world: WorldName,
    seed: Seed = 1,
    profile: Profile = "gp2y0a710k0f",
    autopilot: Autopilot = Autopilot.ARDUPILOT,
    start: Start = None,
    params: Params = None,
    param: Param = None,
    beam: BeamFile = None,
    crop: Crop = None,
    battery_s: Battery = None,
    clutter: Clutter = 0.0,
    clutter_seed: ClutterSeed = None,
    mission: Annotated[
        str,
        typer.Option(help=f"Mission: {', '.join(MISSION_KINDS)}, or a mission file, .toml or .py."),
    ] = "room",
    mission_set: MissionSet = None,
    config: ConfigFile = None,
    transport: Annotated[
        Transport,
        typer.Option(help="direct, bytes: one process; udp: one for sitl, one for each companion."),
    ] = Transport.DIRECT,
    speed: Annotated[
        float,
        typer.Option(help="With udp: limit of the speed, times real time.", min=0.1, max=MAX_SPEED),
    ] = MAX_SPEED,
    sorties: Annotated[
        int, typer.Option(help="Flights of a survey, each with a full battery.", min=1, max=50)
    ] = 1,
    then: Annotated[
        str | None,
        typer.Option(help="With --sorties: the world from the second flight on.", metavar="WORLD"),
    ] = None,
    team: Annotated[int, typer.Option(help="Drones that fly together.", min=1, max=MAX_DRONES)] = 1,
    report: Annotated[Path | None, typer.Option(help="File for the report, JSON.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for all files of the flight.")] = None,
    foxglove: Foxglove = None,
) -> None:
    """Fly a mission and score it. Exit status 0 only if it was completed."""
    # These modules load the companion, its filters and the scorer; `sitl run` does not need them.
    from sitl.running.missions import fly_in_one_process, fly_in_two  # noqa: PLC0415
    from sitl.scoring.report import report_table, save_report  # noqa: PLC0415
    from sitl.testing.mission_file import load_mission  # noqa: PLC0415

    options = FlightOptions(
        world,
        seed,
        profile,
        autopilot.value,
        start,
        params,
        param or (),
        beam,
        crop,
        config,
        battery_s,
        clutter,
        clutter_seed,
    )
    flown = load_mission(mission)
    if foxglove and (sorties > 1 or team > 1):
        raise SitlError("--foxglove shows one drone on one flight, not --team or --sorties")
    streamed = {"view.foxglove": foxglove} if foxglove else {}
    chosen = {**mission_settings(mission_set or ()), **streamed}
    files = {key: file for key, file in flown.sources.items() if key not in chosen}
    settings = options.settings({**flown.settings, **chosen}, files)
    console = Console(highlight=False, markup=False)
    outputs: list[Callable[[], object]] = []
    missed = ""
    reported: dict[str, object] = {}
    if then and sorties == 1:
        raise SitlError("--then needs --sorties: the world changes between two flights")
    if sorties > 1:
        if transport is not Transport.DIRECT or flown.events:
            raise SitlError("--sorties needs --transport direct, and a mission without events")
        from sitl.running.sorties import fly_survey  # noqa: PLC0415

        survey = fly_survey(
            options, settings, sorties, drones=team, then=then, out=out, console=console
        )
        result, reported = survey.joint, survey.as_json()
        outputs += [partial(save, survey.merged.plan, out)] if out else []
    elif team > 1:
        if transport is Transport.BYTES or flown.events:
            raise SitlError("--team needs --transport direct or udp, and a mission without events")
        from sitl.running.team import fly_team, fly_team_in_processes  # noqa: PLC0415

        if transport is Transport.UDP:
            out = out or Path("out")
            joint = fly_team_in_processes(options, settings, team, speed, out=out, console=console)
        else:
            joint = fly_team(options, settings, team, out=out, console=console)
        result, reported = joint.joint, joint.as_json()
        outputs += [partial(save, joint.merged.plan, out)] if out else []
    elif transport is Transport.UDP:
        result = fly_in_two(
            options, flown, settings, speed, out=out or Path("out"), console=console
        )
    else:
        result, plan, missed = fly_in_one_process(
            options, flown, settings, transport.value, out=out, console=console
        )
        unfinished = "" if result["completed"] else str(result["ending"])
        outputs += [partial(save, plan, out, unfinished)] if out else []
    console.print(report_table(result))
    for path in filter(None, (report, out / "report.json" if out else None)):
        outputs.append(partial(save_report, reported or result, path))
    each_by_itself(outputs)
    if missed:
        raise SitlError(f"{mission}: the flight ended before these events: {missed}")
    raise typer.Exit(0 if result["completed"] else EXIT_NOT_COMPLETED)


def main() -> None:
    """Run a command. Errors are one line on stderr and exit status 2."""
    terminal.set_up()
    try:
        with needs_extra("sitl"), terminal.checked_output("sitl"):
            commands()
    except (SitlError, WorldError, CompanionError) as error:
        # a file's content may look like the console's markup
        console = Console(stderr=True, highlight=False, markup=False)
        console.print(f"sitl: {error}", soft_wrap=True)
        raise SystemExit(EXIT_REFUSED) from None
