"""Runs a flight without an operator, from connecting to the map, and sets the exit status."""

import signal
import time
from pathlib import Path

from rich.console import Console

from companion.app import App
from companion.core.errors import CompanionError
from companion.core.messages import FloorPlan
from companion.export.map_files import AutoSave, save
from companion.pdps.flight.state import FlightState, Phase
from companion.recording.recorder import Recorder
from companion.run.console import ProgressLine, summary
from companion.run.loop import ControlLoop, Record, Rig, record_nothing
from companion.run.systemd import Service
from companion.ticks import Inputs, Outputs, Progress

EXIT_FAILED = 1
"""Exit status after an error, as of any program: the caller starts the recovery."""
EXIT_ENDED = 3
"""Exit status of an incomplete mission or an unsaved map, without a recovery.

The drone has landed or is under the pilot's control.
"""


def fly_to_the_end(
    app: App,
    rig: Rig,
    recorder: Recorder,
    *,
    out: Path,
    console: Console,
    look_on: Record = record_nothing,
) -> int:
    """Fly and save the map; returns the exit status.

    On an error, the current map is saved at once and the recording is kept, so that `companion
    recover` can continue from them. `look_on` is called at every tick.
    """
    autosave = AutoSave(out, app.floor_plan, console.print)
    service = Service()
    interrupted = _Interruption(console)
    began_s = time.monotonic()
    try:
        with ProgressLine(console) as line:

            def watch(progress: Progress) -> None:
                service.alive(progress.activity)
                line.show(progress)
                autosave.update(progress.time_s)

            def record(now_s: float, inputs: Inputs, outputs: Outputs) -> None:
                recorder.tick(now_s, inputs, outputs)
                look_on(now_s, inputs, outputs)

            ControlLoop(app, rig, watch, interrupted.requested, record).run()
    except KeyboardInterrupt:
        _leave(app, recorder, service, autosave, out=out, console=console)
        raise
    except Exception:
        autosave.save_at_once()
        raise
    plan, files = _leave(app, recorder, service, autosave, out=out, console=console)
    console.print(summary(app.flight, plan, files, time.monotonic() - began_s))
    return exit_status(app.flight) if files else exit_status(app.flight) or EXIT_ENDED


def exit_status(flight: FlightState) -> int:
    """Exit status of an ended flight, which systemd's units evaluate."""
    if flight.completed:
        return 0
    is_broken_off = flight.phase is Phase.FAILED and not flight.is_others
    return EXIT_FAILED if is_broken_off else EXIT_ENDED


def _leave(
    app: App,
    recorder: Recorder,
    service: Service,
    autosave: AutoSave,
    *,
    out: Path,
    console: Console,
) -> tuple[FloorPlan, list[Path]]:
    """Compute and save the map; returns it with its files, none if they cannot be written."""
    service.landed()
    autosave.settle()
    plan = FloorPlan()
    try:
        plan = app.final_floor_plan()
        recorder.close(plan)
        return plan, save(plan, out, app.flight.unfinished)
    except Exception as error:  # the flight is over and keeps its status
        reason = error if isinstance(error, CompanionError) else repr(error)
        console.print(f"the map is not saved: {reason}", soft_wrap=True)
        return plan, []


class _Interruption:
    """Ctrl-C or a stop of the service requests a landing; a second Ctrl-C ends the program."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._requested = False
        signal.signal(signal.SIGINT, self._request)
        signal.signal(signal.SIGTERM, self._request)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the flight does not need its terminal

    def _request(self, number: int, frame: object) -> None:
        if self._requested and number == signal.SIGINT:
            raise KeyboardInterrupt
        self._requested = True
        self._console.print("landing; press Ctrl-C again to leave the drone to the autopilot")

    def requested(self) -> bool:
        return self._requested
