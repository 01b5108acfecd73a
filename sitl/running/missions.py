"""Flies and scores a mission, in one process or in two, for `sitl fly`."""

import time
from functools import partial
from pathlib import Path

from rich.console import Console

from companion.config.settings import Config
from companion.core.messages import FloorPlan
from companion.recording.recorder import NOT_RECORDED, open_recorder
from companion.run.console import ProgressLine
from companion.view.foxglove_live import publish_too
from sitl.core.errors import SitlError
from sitl.running.options import FlightOptions
from sitl.running.processes import fly_in_two_processes
from sitl.scoring.report import Report, make_report
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.testing.mission_file import MissionFile
from sitl.testing.script import Play
from sitl.world.checking import warnings
from sitl.world.format import World


def fly_in_one_process(
    options: FlightOptions,
    mission: MissionFile,
    settings: Config,
    transport: str,
    *,
    out: Path | None,
    console: Console,
) -> tuple[Report, FloorPlan, str]:
    """Fly in lockstep on virtual time; return scores, map, and the events that did not happen.

    The recording is written to `out`, the map is not.
    """
    began_s = time.monotonic()
    setup, watch = options.setup()
    _warn(setup.world, console)
    script = Play(mission.events)
    recorder = open_recorder(out, settings, time.time(), console.print) if out else NOT_RECORDED
    recorder = publish_too(recorder, settings, partial(console.print, soft_wrap=True))
    with ProgressLine(console) as progress:
        app, simulation = fly_in_lockstep(
            setup,
            settings,
            progress.show,
            transport,
            script,
            parameter_watch=watch,
            recorder=recorder,
        )
    waited_s = time.monotonic() - began_s
    plan = app.final_floor_plan()
    recorder.close(plan)
    scores = make_report(
        setup,
        settings,
        plan,
        simulation.record,
        outcome=app.flight,
        waited_s=waited_s,
    )
    return scores, plan, script.missed


def fly_in_two(
    options: FlightOptions,
    mission: MissionFile,
    settings: Config,
    speed: float,
    *,
    out: Path,
    console: Console,
) -> Report:
    """Fly over UDP and a served bus, as on a drone.

    Raises:
        SitlError: the mission has events, which another process cannot trigger.
    """
    if mission.events:
        raise SitlError("a mission with events needs --transport direct or bytes")
    began_s = time.monotonic()
    setup, _ = options.setup()
    _warn(setup.world, console)
    flight = fly_in_two_processes([*options.arguments(), f"--speed={speed}"], settings, out)
    return make_report(
        setup,
        settings,
        flight.plan,
        flight.truth,
        outcome=flight,
        waited_s=time.monotonic() - began_s,
    )


def _warn(world: World, console: Console) -> None:
    """Print the warnings of `sitl world check`, which limit what the scores mean."""
    for warning in warnings(world):
        console.print(f"warning: {warning}", soft_wrap=True)
