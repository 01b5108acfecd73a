"""Flies a survey in simulation: several flights from one pad, with one joint map.

    flight 1 ─► joint map ─► flight 2 ─► joint map ─► ...
                               ▲ knows the map of flight 1

Before each flight the battery is full again. Noise, drift and gains are drawn anew, and the drone
stands some centimetres and degrees off the pad.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from companion.app import App, Progress
from companion.config.settings import Config
from companion.core.errors import SurveyError
from companion.earlier import EarlierFlights
from companion.recording.recorder import NOT_RECORDED, FlightRecorder, Recorder, open_recorder
from companion.run.console import ProgressLine
from companion.survey.flights import Flown
from companion.survey.folder import Pad
from companion.survey.merge import Merged, Starts, merge
from companion.survey.solved import keep
from sitl.core.errors import SitlError
from sitl.core.noise import stream
from sitl.running.options import FlightOptions
from sitl.scoring.joint import return_m, together
from sitl.scoring.report import Report, least_clear_in_the_open_m, make_report
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup, start_state
from sitl.world.format import World
from sitl.world.loading import load_world

PAD = Pad()
"""How exactly a person puts the drone on the pad: the default of a survey."""
_ROWS = (
    ("flight", "{}"),
    ("ending", "{}"),
    ("flight_time_s", "{:.0f}"),
    ("collisions", "{}"),
    ("clearance_m", "{:.2f}"),
    ("return_m", "{:.2f}"),
    ("coverage", "{:.1%}"),
    ("wall_error_aligned_cm", "{:.1f}"),
)
"""Keys and formats of the terminal's table."""


@dataclass(frozen=True, slots=True)
class SurveyResult:
    """A survey as `sitl fly` reports it."""

    joint: Report
    """Scores of the joint map."""
    rows: list[Report]
    """Each flight's own results."""
    merged: Merged

    def as_json(self) -> dict[str, object]:
        """The scores, with the rows as `sorties` and what has changed between flights."""
        changes = [asdict(change) for change in self.merged.changes]
        return {**self.joint, "sorties": self.rows, "changes": changes}


@dataclass(frozen=True, slots=True)
class Sortie:
    """One flight of a survey, and the joint map after it."""

    flight: Report
    """The flight's own results."""
    joint: Report
    """Scores of the joint map so far, with the keys of a single flight's report."""
    merged: Merged


def fly_survey(
    options: FlightOptions,
    settings: Config,
    count: int,
    *,
    then: str | None,
    out: Path | None,
    console: Console,
) -> SurveyResult:
    """Fly a survey for `sitl fly`.

    The recordings are written to `out`, which is then a survey's folder. The map is not. `then`:
    the world from the second flight on.

    Raises:
        SitlError: no flight can be made into a map.
    """
    setup, _ = options.setup()
    table = Table(title=f"flights of {setup.world.name}", title_justify="left")
    for column, _ in _ROWS:
        table.add_column(column)
    rows: list[Report] = []
    with ProgressLine(console) as progress:
        changed = load_world(then) if then else None
        sorties = Sorties(setup, settings, progress.show, out, console.print, then=changed)
        for sortie in sorties.fly(count):
            rows.append(sortie.flight)
            table.add_row(*(form.format(sortie.flight[key]) for key, form in _ROWS))
    if not rows:
        raise SitlError("no flight of the survey can be made into a map")
    console.print(table)
    for change in sortie.merged.changes:
        found_by = sortie.merged.flights[change.flight].name
        console.print(change.in_words(found_by), soft_wrap=True)
    return SurveyResult(sortie.joint, rows, sortie.merged)


class Sorties:
    """Flies the flights of a survey in lockstep. `out`: folder for the recordings, or None."""

    def __init__(
        self,
        setup: Setup,
        settings: Config,
        watch: Callable[[Progress], None],
        out: Path | None = None,
        tell: Callable[[str], None] = print,
        *,
        then: World | None = None,
    ) -> None:
        """`then`: the world from the second flight on, if it has changed."""
        self._setup, self._settings = setup, settings
        self._then = then or setup.world
        self._watch, self._tell, self._out = watch, tell, out
        self._flown: list[Flown] = []
        self.truths: list[TruthRecord] = []
        """The true course of each flight so far."""
        self._earlier: EarlierFlights | None = None

    def fly(self, count: int) -> Iterator[Sortie]:
        """Fly up to `count` flights; end early when the mission is complete."""
        began_s = time.monotonic()
        for number in range(1, count + 1):
            app, recording = self._fly(number)
            try:
                flown = Flown.of(f"flight {number}", app)
            except SurveyError as error:
                self._tell(str(error))
                continue
            if recording:
                keep(flown, recording, recording.parent)
            self._flown.append(flown)
            merged = merge(self._flown, Starts(PAD.sigma))
            self._earlier = merged.for_next_flight(PAD.sigma)
            yield self._scored(number, app, merged, time.monotonic() - began_s)
            if app.flight.completed:
                return

    def _fly(self, number: int) -> tuple[App, Path | None]:
        """Fly; return the companion at the end, and the recording if there is one."""
        recorder: Recorder = NOT_RECORDED
        if self._out:
            recorder = open_recorder(
                self._out, self._settings, time.time(), self._tell, earlier=self._earlier
            )
        app, simulation = fly_in_lockstep(
            on_the_pad(self._setup, number, self._then),
            self._settings,
            self._watch,
            make_app=partial(App, earlier=self._earlier),
            recorder=recorder,
        )
        if self._out:
            recorder.close(app.final_floor_plan())
        self.truths.append(simulation.record)
        return app, recorder.path if isinstance(recorder, FlightRecorder) else None

    def _scored(self, number: int, app: App, merged: Merged, waited_s: float) -> Sortie:
        truths = self.truths
        joint = make_report(
            self._setup if number == 1 else replace(self._setup, world=self._then),
            self._settings,
            merged.plan,
            together(truths, merged),
            outcome=app.flight,
            waited_s=waited_s,
        )
        joint["return_m"] = round(max(return_m(each) for each in truths), 4)
        worlds = (self._setup.world, *(self._then,) * (len(truths) - 1))
        joint["clearance_open_m"] = min(map(least_clear_in_the_open_m, worlds, truths))
        return Sortie(_row(number, app, truths[-1], joint), joint, merged)


def on_the_pad(setup: Setup, number: int, then: World) -> Setup:
    """The setup of the n-th flight: drawn anew, and put on the pad by hand from the second on.

    `then`: the world from the second flight on.
    """
    if number == 1:
        return setup
    draw = stream(setup.seed, f"sortie {number}")
    first = start_state(setup)
    north_m, east_m, _ = first.position_ned_m
    start = setup.world.starts[setup.start].model_copy(
        update={
            "position": (draw.gauss(north_m, PAD.sigma_m), draw.gauss(east_m, PAD.sigma_m)),
            "heading_deg": draw.gauss(math.degrees(first.yaw_rad), PAD.sigma_deg),
        }
    )
    world = then.model_copy(update={"starts": (start,)})
    return replace(setup, world=world, start=0, seed=draw.randrange(2**31))


def _row(number: int, app: App, truth: TruthRecord, joint: Report) -> Report:
    """Results of one flight, and the coverage that the survey has with it."""
    ending = app.flight.ending
    return {
        "flight": number,
        "completed": app.flight.completed and truth.collisions == 0,
        "ending": f"to be continued: {ending}" if app.flight.is_to_be_continued else ending,
        "flight_time_s": round(truth.air_time_s, 2),
        "collisions": truth.collisions,
        "clearance_m": round(truth.clearance_m, 4),
        "return_m": round(return_m(truth), 4),
        "coverage": joint["coverage"],
        "wall_error_aligned_cm": joint["wall_error_aligned_cm"],
    }
