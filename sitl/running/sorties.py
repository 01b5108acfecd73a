"""Flies a survey in simulation: several sorties of one drone or of a team, with one joint map.

    sortie 1 ─► joint map ─► sortie 2 ─► joint map ─► ...
                               ▲ knows the map of sortie 1

Before each sortie the batteries are full again. Noise, drift and gains are drawn anew, and each
drone stands some centimetres and degrees off its pad.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from companion.app import App
from companion.config.settings import Config
from companion.core.arrays import Array
from companion.core.errors import SurveyError
from companion.earlier import EarlierFlights
from companion.recording.recorder import NOT_RECORDED, FlightRecorder, Recorder, open_recorder
from companion.run.console import ProgressLine
from companion.survey.flights import Flown
from companion.survey.folder import Pad
from companion.survey.merge import Merged, Starts, merge
from companion.survey.solved import keep
from companion.survey.team_starts import pad_of
from companion.team.pads import pad_sigma, relative_pad
from companion.ticks import Progress
from sitl.core.errors import SitlError
from sitl.core.noise import stream
from sitl.running.options import FlightOptions
from sitl.scoring.joint import Outcome, airborne_s, apart_m, flight_name, return_m, together
from sitl.scoring.report import Report, least_clear_in_the_open_m, make_report
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup, start_state
from sitl.simulation.team import fly_team_in_lockstep
from sitl.simulation.team_pads import team_setups
from sitl.world.format import World
from sitl.world.loading import load_world

PAD = Pad()
"""How exactly a person puts the drone on the pad: the default of a survey."""
_TEAM_ROWS = (("sortie", "{}"), ("drone", "{}"))
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
"""Keys and formats of the terminal's table: for a team, and for all."""


@dataclass(frozen=True, slots=True)
class SurveyResult:
    """A survey as `sitl fly` reports it."""

    joint: Report
    """Scores of the joint map."""
    rows: list[Report]
    """Each flight's own results."""
    merged: Merged

    def as_json(self) -> dict[str, object]:
        """The scores, with the flights' rows as `sorties`, and what has changed between flights."""
        changes = [asdict(change) for change in self.merged.changes]
        return {**self.joint, "sorties": self.rows, "changes": changes}


@dataclass(frozen=True, slots=True)
class Sortie:
    """One flight of a survey, or those of a team at the same time, and the joint map after it."""

    rows: tuple[Report, ...]
    """Each flight's own results."""
    joint: Report
    """Scores of the joint map so far, with the keys of a single flight's report."""
    merged: Merged


def fly_survey(
    options: FlightOptions,
    settings: Config,
    count: int,
    *,
    drones: int,
    then: str | None,
    out: Path | None,
    console: Console,
) -> SurveyResult:
    """Fly a survey for `sitl fly`.

    The recordings are written to `out`, which is then a survey's folder. The map is not. `then`:
    the world from the second sortie on.

    Raises:
        SitlError: no flight can be made into a map, or there is no place for a pad.
        ConfigError: the mission is not one that so many drones divide.
    """
    setup, _ = options.setup()
    table = Table(title=f"flights of {setup.world.name}", title_justify="left")
    columns = (*_TEAM_ROWS, *_ROWS) if drones > 1 else _ROWS
    for column, _ in columns:
        table.add_column(column)
    rows: list[Report] = []
    with ProgressLine(console) as progress:
        changed = load_world(then) if then else None
        sorties = Sorties(
            setup, settings, progress.show, out, console.print, drones=drones, then=changed
        )
        for sortie in sorties.fly(count):
            rows += sortie.rows
            for row in sortie.rows:
                table.add_row(*(form.format(row[key]) for key, form in columns))
    if not rows:
        raise SitlError("no flight of the survey can be made into a map")
    console.print(table)
    for change in sortie.merged.changes:
        found_by = sortie.merged.flights[change.flight].name
        console.print(change.in_words(found_by), soft_wrap=True)
    return SurveyResult(sortie.joint, rows, sortie.merged)


class Sorties:
    """Flies the sorties of a survey in lockstep. `out`: folder for the recordings, or None."""

    def __init__(
        self,
        setup: Setup,
        settings: Config,
        watch: Callable[[Progress], None],
        out: Path | None = None,
        tell: Callable[[str], None] = print,
        *,
        drones: int = 1,
        then: World | None = None,
    ) -> None:
        """`watch` is called with the progress of the first drone.

        `then`: the world from the second sortie on, if it has changed.
        """
        self._setup = setup
        self._setups, self._configs = [setup], [settings]
        if drones > 1:
            self._setups, self._configs = team_setups(setup, settings, drones)
        pads = [pad_of(config.team) for config in self._configs]
        self._pads = [relative_pad(pads[0], pad) for pad in pads]
        self._sigma = PAD.sigma
        if drones > 1:
            self._sigma = np.maximum(PAD.sigma, pad_sigma(self._configs[0].team))
        self._then = then or setup.world
        self._watch, self._tell, self._out = watch, tell, out
        self._flown: list[Flown] = []
        self._starts: dict[str, Array] = {}
        self._earlier: list[EarlierFlights | None] = [None] * drones
        self._airborne_s = 0.0
        self.truths: list[TruthRecord] = []
        """The true course of each flight so far."""

    @property
    def _is_team(self) -> bool:
        return len(self._configs) > 1

    def fly(self, count: int) -> Iterator[Sortie]:
        """Fly up to `count` sorties; end early when the mission is complete."""
        began_s = time.monotonic()
        for number in range(1, count + 1):
            flights = self._fly(number)
            before = len(self._flown)
            for name, (app, recording), pad in zip(
                self._names_of_latest(), flights, self._pads, strict=True
            ):
                try:
                    flown = Flown.of(name, app)
                except SurveyError as error:
                    self._tell(str(error))
                    continue
                if recording:
                    keep(flown, recording, recording.parent)
                self._flown.append(flown)
                self._starts[name] = pad
            if len(self._flown) == before:
                continue
            merged = merge(self._flown, Starts(self._sigma, self._starts))
            self._earlier = [merged.for_next_flight(self._sigma, pad) for pad in self._pads]
            apps = [app for app, _ in flights]
            yield self._scored(number, apps, merged, time.monotonic() - began_s)
            if all(app.flight.completed for app in apps):
                return

    def _names_of_latest(self) -> list[str]:
        """Names of the flights of the latest sortie."""
        return [flight_name(number + 1) for number in range(len(self.truths))][-len(self._pads) :]

    def _fly(self, number: int) -> list[tuple[App, Path | None]]:
        """Fly a sortie; return the companions at the end, and the recordings if there are any."""
        setups = [on_the_pad(setup, number, self._then) for setup in self._setups]
        recorders: list[Recorder] = [
            open_recorder(self._out, config, time.time(), self._tell, earlier=earlier)
            if self._out
            else NOT_RECORDED
            for config, earlier in zip(self._configs, self._earlier, strict=True)
        ]
        fly = self._fly_team if self._is_team else self._fly_alone
        apps = fly(setups, recorders)
        if self._out:
            for recorder, app in zip(recorders, apps, strict=True):
                recorder.close(app.final_floor_plan())
        paths = [each.path if isinstance(each, FlightRecorder) else None for each in recorders]
        return list(zip(apps, paths, strict=True))

    def _fly_alone(self, setups: list[Setup], recorders: list[Recorder]) -> list[App]:
        app, simulation = fly_in_lockstep(
            setups[0],
            self._configs[0],
            self._watch,
            make_app=partial(App, earlier=self._earlier[0]),
            recorder=recorders[0],
        )
        self.truths.append(simulation.record)
        return [app]

    def _fly_team(self, setups: list[Setup], recorders: list[Recorder]) -> list[App]:
        flight = fly_team_in_lockstep(
            setups,
            self._configs,
            lambda drone, shown: self._watch(shown) if drone == 0 else None,
            recorders=recorders,
            earlier=self._earlier,
        )
        truths = [vehicle.record for vehicle in flight.fleet.vehicles]
        self.truths += truths
        self._airborne_s += airborne_s(truths)
        return list(flight.apps)

    def _scored(self, number: int, apps: list[App], merged: Merged, waited_s: float) -> Sortie:
        truths = self.truths
        joint = make_report(
            self._setup if number == 1 else replace(self._setup, world=self._then),
            self._configs[0],
            merged.plan,
            together(truths, merged),
            outcome=Outcome([app.flight for app in apps]),
            waited_s=waited_s,
        )
        joint["return_m"] = round(max(return_m(each) for each in truths), 4)
        drones = len(apps)
        worlds = [self._setup.world] * drones + [self._then] * (len(truths) - drones)
        joint["clearance_open_m"] = min(map(least_clear_in_the_open_m, worlds, truths))
        if self._is_team:
            joint["flight_time_s"] = round(self._airborne_s, 4)
            joint["apart_m"] = apart_m(truths)
        first = len(truths) - drones + 1
        rows = [
            _row(first + drone, app, truth, joint)
            for drone, (app, truth) in enumerate(zip(apps, truths[-drones:], strict=True))
        ]
        if self._is_team:
            rows = [{"sortie": number, "drone": n, **row} for n, row in enumerate(rows, 1)]
        return Sortie(tuple(rows), joint, merged)


def on_the_pad(setup: Setup, number: int, then: World) -> Setup:
    """The setup of the n-th sortie: drawn anew, and put on the pad by hand from the second on.

    `then`: the world from the second sortie on.
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
