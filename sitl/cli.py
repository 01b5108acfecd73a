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
from companion.link.transport import UdpTransport
from companion.mapping.files import save
from sitl.errors import SitlError
from sitl.lockstep import fly_in_lockstep
from sitl.processes import fly_in_two_processes
from sitl.report import Report, make_report, report_table, save_report
from sitl.run import Server
from sitl.simulation import Setup, Simulation
from sitl.world.cli import commands as world_commands
from sitl.world.format import WorldError
from sitl.world.loading import load_world

EXIT_NOT_COMPLETED = 1
EXIT_REFUSED = 2
AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT = 1, 1

commands = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Simulated rooms, autopilot and sensors for the companion.",
)


commands.add_typer(world_commands, name="world")


class Transport(StrEnum):
    """How the companion and SITL meet."""

    DIRECT = "direct"
    BYTES = "bytes"
    UDP = "udp"


World = Annotated[str, typer.Argument(help="A built-in world, or a world file.")]
Seed = Annotated[int, typer.Option(help="The same seed gives the same flight, to the bit.")]


class Personality(StrEnum):
    """Which autopilot the vehicle answers as."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


Profile = Annotated[str, typer.Option(help="Range sensors: gp2y0a710k0f or paper.")]


@commands.command()
def run(
    world: World,
    seed: Seed = 1,
    profile: Profile = "gp2y0a710k0f",
    autopilot: Personality = Personality.ARDUPILOT,
    mavlink: Annotated[
        str, typer.Option(help="udpout:HOST:PORT or udpin:HOST:PORT.")
    ] = "udpout:127.0.0.1:14550",
    bus_port: Annotated[int, typer.Option(help="TCP port of the sensor bus; 0: any.")] = 5790,
    speed: Annotated[float, typer.Option(help="Most times real time.", min=0.1, max=1000)] = 1.0,
    lockstep: Annotated[
        bool, typer.Option(help="Time stands still until a companion asks for it.")
    ] = False,
    truth: Annotated[Path | None, typer.Option(help="Write the true flight here.")] = None,
) -> None:
    """Serve a vehicle in a world: MAVLink on UDP, its sensors on TCP; Ctrl-C ends it."""
    setup = _setup(world, seed, profile, autopilot)
    transport = UdpTransport(mavlink, AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT)
    simulation = Simulation(setup, transport)
    server = Server(simulation, transport, bus_port=bus_port, speed=speed, lockstep=lockstep)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: server.stop())
    kind, host, port = mavlink.split(":")
    shown_port = transport.local_port if kind == "udpin" else port
    print(f"world    {world}, seed {seed}, sensors {profile}, autopilot {autopilot.value}")
    print(f"MAVLink  {kind}:{host}:{shown_port}")
    print(f"sensors  sitl://127.0.0.1:{server.bus_port}", flush=True)
    server.serve()
    if truth is not None:
        simulation.record.save(truth)


@commands.command()
def fly(
    world: World,
    seed: Seed = 1,
    profile: Profile = "gp2y0a710k0f",
    autopilot: Personality = Personality.ARDUPILOT,
    mission: Annotated[str, typer.Option(help="What to fly: room.")] = "room",
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
    setup = _setup(world, seed, profile, autopilot)
    overrides = {"sensors.profile": profile, "mission.kind": mission}
    settings = configuration.load(config, overrides)
    console = Console(highlight=False)
    began_s = time.monotonic()
    if transport is Transport.UDP:
        result = _fly_udp(setup, settings, config, speed, out or Path("out"), began_s)
    else:
        result = _fly_lockstep(setup, settings, transport, out, console, began_s)
    console.print(report_table(result))
    for path in filter(None, (report, out / "report.json" if out else None)):
        save_report(result, path)
    raise typer.Exit(0 if result["completed"] else EXIT_NOT_COMPLETED)


def _fly_lockstep(
    setup: Setup,
    settings: Config,
    transport: Transport,
    out: Path | None,
    console: Console,
    began_s: float,
) -> Report:
    with ProgressLine(console) as progress:
        app, simulation = fly_in_lockstep(setup, settings, progress.show, transport.value)
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
    setup: Setup,
    settings: Config,
    config: Path | None,
    speed: float,
    out: Path,
    began_s: float,
) -> Report:
    shared = ("--profile", setup.sensors.profile)
    sitl_arguments = (
        setup.world_name,
        *("--seed", str(setup.seed), "--speed", str(speed), "--autopilot", setup.autopilot),
        *shared,
    )
    companion_arguments = ("--config", str(config), *shared) if config else shared
    plan, truth, status = fly_in_two_processes(sitl_arguments, companion_arguments, out)
    return make_report(
        setup,
        settings,
        plan,
        truth,
        completed=status == 0,
        ending="mission complete" if status == 0 else "mission not completed",
        waited_s=time.monotonic() - began_s,
    )


def _setup(world: str, seed: int, profile: str, autopilot: Personality) -> Setup:
    sensors = configuration.load(None, {"sensors.profile": profile}).sensors
    return Setup(load_world(world), world, seed, sensors, autopilot.value)


def main() -> None:
    """Run a command; anything refused is one line on stderr and exit status 2."""
    try:
        commands()
    except (SitlError, WorldError, CompanionError) as error:
        # what stands in a file may look like the console's markup
        console = Console(stderr=True, highlight=False, markup=False)
        console.print(f"sitl: {error}", soft_wrap=True)
        raise SystemExit(EXIT_REFUSED) from None
