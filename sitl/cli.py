"""The simulator's commands."""

import signal
import time
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion import config as configuration
from companion.config import Config
from companion.console import ProgressLine
from companion.errors import CompanionError
from companion.mapping.files import save
from sitl.bare import fly_bare
from sitl.bench.cli import commands as bench_commands
from sitl.errors import SitlError
from sitl.lockstep import fly_in_lockstep
from sitl.options import (
    Autopilot,
    BeamFile,
    Crop,
    FlightOptions,
    Param,
    Params,
    Profile,
    Seed,
    Start,
    WorldName,
)
from sitl.processes import fly_in_two_processes
from sitl.record import TruthRecord
from sitl.report import Report, make_report, report_table, save_report
from sitl.run import Door, Server
from sitl.serving import external_door, fleet_doors
from sitl.testing.mission_file import MissionFile, load_mission
from sitl.testing.script import play
from sitl.world.cli import commands as world_commands
from sitl.world.format import WorldError

EXIT_NOT_COMPLETED = 1
EXIT_REFUSED = 2
DEFAULT_MAVLINK = "udpout:127.0.0.1:14550"

commands = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Simulated rooms, autopilot and sensors for the companion.",
)
commands.add_typer(world_commands, name="world")
commands.add_typer(bench_commands, name="bench")


class RunAutopilot(StrEnum):
    """Emulated here, or elsewhere."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"
    EXTERNAL = "external"


class Transport(StrEnum):
    """How the companion and SITL meet."""

    DIRECT = "direct"
    BYTES = "bytes"
    UDP = "udp"


BusPort = Annotated[int, typer.Option(help="TCP port of the sensor bus; 0: any.")]
Mavlink = Annotated[
    list[str] | None,
    typer.Option(help="udpin:HOST:PORT or udpout:HOST:PORT; repeatable, the companion's first."),
]
"""14550 if left out."""


@commands.command()
def run(
    world: WorldName,
    seed: Seed = 1,
    profile: Profile = "gp2y0a710k0f",
    autopilot: Annotated[
        RunAutopilot, typer.Option(help="Emulated here, or external: one that flies by itself.")
    ] = RunAutopilot.ARDUPILOT,
    start: Start = None,
    params: Params = None,
    param: Param = None,
    beam: BeamFile = None,
    crop: Crop = None,
    vehicles: Annotated[
        int, typer.Option(help="So many, each with its own link and bus on the next ports.", min=1)
    ] = 1,
    mavlink: Mavlink = None,
    connect: Annotated[
        str, typer.Option(help="External: where its MAVLink is, udpin or udpout:HOST:PORT.")
    ] = "udpin:127.0.0.1:14551",
    bus_port: BusPort = 5790,
    speed: Annotated[float, typer.Option(help="Most times real time.", min=0.1, max=1000)] = 1.0,
    lockstep: Annotated[
        bool, typer.Option(help="Time stands still until every companion asks for it.")
    ] = False,
    truth: Annotated[Path | None, typer.Option(help="Write the true flight here.")] = None,
) -> None:
    """Serve vehicles in a world: MAVLink on UDP, their sensors on TCP; Ctrl-C ends it."""
    print(f"world    {world}, seed {seed}, sensors {profile}, autopilot {autopilot.value}")
    if autopilot is RunAutopilot.EXTERNAL:
        options = FlightOptions(
            world, seed, profile, Autopilot.ARDUPILOT, start, beam=beam, crop_m=crop
        )
        _run_external(options, connect, bus_port, speed, truth)
        return
    options = FlightOptions(
        world, seed, profile, autopilot.value, start, params, param or (), beam, crop
    )
    setup, watch = options.setup()
    fleet, doors = fleet_doors(setup, watch, vehicles, mavlink or [DEFAULT_MAVLINK], bus_port)
    for number, door in enumerate(doors):
        _tell_door(door, f"system {setup.system_id + number}" if vehicles > 1 else "")
    _serve(Server(fleet, doors, speed=speed, lockstep=lockstep))
    _save_truth([vehicle.record for vehicle in fleet.vehicles], truth)


def _run_external(
    options: FlightOptions, connect: str, bus_port: int, speed: float, truth: Path | None
) -> None:
    vehicle, door, address = external_door(options.setup()[0], connect, bus_port, speed, _say)
    print(f"MAVLink  {address}, for the simulator; give the companion a link of its own")
    print(f"sensors  sitl://127.0.0.1:{door.bus_port}", flush=True)
    _serve(Server(vehicle, [door], speed=speed))
    _save_truth([vehicle.record], truth)


def _say(text: str) -> None:
    print(text, flush=True)


def _tell_door(door: Door, whose: str) -> None:
    for transport in door.transports:
        print(f"MAVLink  {transport.address}  {whose}".rstrip())
    print(f"sensors  sitl://127.0.0.1:{door.bus_port}  {whose}".rstrip(), flush=True)


def _serve(server: Server) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: server.stop())
    server.serve()
    print(f"attended {server.attended_for_s:.3f} s", flush=True)


def _save_truth(records: list[TruthRecord], path: Path | None) -> None:
    """One file for each vehicle; those after the first are numbered."""
    if path is None:
        return
    for number, record in enumerate(records):
        record.save(path if number == 0 else path.with_stem(f"{path.stem}_{number + 1}"))


@commands.command()
def autopilot(
    autopilot: Autopilot = Autopilot.ARDUPILOT,
    seed: Seed = 1,
    params: Params = None,
    param: Param = None,
    mavlink: Mavlink = None,
    speed: Annotated[float, typer.Option(help="Times real time.", min=0.1, max=100)] = 1.0,
) -> None:
    """An emulated autopilot alone on an endless field, telling its true state; Ctrl-C ends it."""
    fly_bare(
        autopilot.value,
        seed,
        mavlink or [DEFAULT_MAVLINK],
        parameter_file=params,
        assignments=param or (),
        speed=speed,
        tell=_say,
    )


@commands.command()
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
    mission: Annotated[
        str, typer.Option(help="What to fly: room, or a mission file, .toml or .py.")
    ] = "room",
    config: Annotated[Path | None, typer.Option(help="The companion's TOML file.")] = None,
    transport: Annotated[
        Transport, typer.Option(help="direct, bytes: one process; udp: two.")
    ] = Transport.DIRECT,
    speed: Annotated[
        float, typer.Option(help="With udp: most times real time.", min=0.1, max=1000)
    ] = 1000.0,
    report: Annotated[Path | None, typer.Option(help="Write the report here as JSON.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for every file of the flight.")] = None,
) -> None:
    """Fly a whole mission and score it; exit status 0 only if it was completed."""
    options = FlightOptions(
        world, seed, profile, autopilot.value, start, params, param or (), beam, crop
    )
    flown = load_mission(mission)
    settings = configuration.load(config, {"sensors.profile": profile, **flown.settings})
    console = Console(highlight=False)
    if transport is Transport.UDP:
        result = _fly_udp(options, flown, settings, speed, out or Path("out"))
    else:
        result = _fly_lockstep(options, flown, settings, transport, out, console)
    console.print(report_table(result))
    for path in filter(None, (report, out / "report.json" if out else None)):
        save_report(result, path)
    raise typer.Exit(0 if result["completed"] else EXIT_NOT_COMPLETED)


def _fly_lockstep(
    options: FlightOptions,
    mission: MissionFile,
    settings: Config,
    transport: Transport,
    out: Path | None,
    console: Console,
) -> Report:
    began_s = time.monotonic()
    setup, watch = options.setup()
    with ProgressLine(console) as progress:
        app, simulation = fly_in_lockstep(
            setup,
            settings,
            progress.show,
            transport.value,
            play(mission.events),
            parameter_watch=watch,
        )
    waited_s = time.monotonic() - began_s
    plan = app.final_floor_plan()
    if out is not None:
        save(plan, out)
    return make_report(
        setup,
        settings,
        plan,
        simulation.record,
        completed=app.flight.completed,
        ending=app.flight.ending,
        waited_s=waited_s,
    )


def _fly_udp(
    options: FlightOptions,
    mission: MissionFile,
    settings: Config,
    speed: float,
    out: Path,
) -> Report:
    if mission.events:
        raise SitlError("a mission with events needs --transport direct or bytes")
    began_s = time.monotonic()
    setup, _ = options.setup()
    flight = fly_in_two_processes([*options.arguments(), f"--speed={speed}"], settings, out)
    return make_report(
        setup,
        settings,
        flight.plan,
        flight.truth,
        completed=flight.completed,
        ending="mission complete" if flight.completed else "mission not completed",
        waited_s=time.monotonic() - began_s,
    )


def main() -> None:
    """Run a command; anything refused is one line on stderr and exit status 2."""
    try:
        commands()
    except (SitlError, WorldError, CompanionError) as error:
        # what stands in a file may look like the console's markup
        console = Console(stderr=True, highlight=False, markup=False)
        console.print(f"sitl: {error}", soft_wrap=True)
        raise SystemExit(EXIT_REFUSED) from None
