"""Flies, scores and sketches missions, also those that fail."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from companion.app import App
from companion.config.settings import Config
from companion.core.frames import Vector2, frd_to_ned
from companion.core.messages import FloorPlan
from companion.safety.health.lateness import TICK_S
from companion.ticks import Progress
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE, OdometryNoise
from sitl.bench.engine import attempted, with_a_bar
from sitl.bench.scan_time import TRACING, ScanTime
from sitl.core.truth import TrueState
from sitl.running.options import FlightOptions
from sitl.scoring.report import Report, make_report
from sitl.sensors.beam import BeamPhysics
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup, Simulation
from sitl.testing.mission_file import MissionFile, load_mission
from sitl.testing.script import Play
from sitl.world.format import Segment
from sitl.world.plan import wall_surfaces

ALARM = "range sensor failed"
"""Beginning of the companion's trouble text; `companion/safety/health/watch.py`."""
WALLS_OF_A_ROOM = 4
"""Walls of a room for which the bound (P - 8·d) / v applies."""


@dataclass(frozen=True, slots=True)
class Physics:
    """What a campaign varies in the simulator, beside the options of a flight."""

    beam: BeamPhysics | None = None
    """None: as in the options."""
    odometry_noise: OdometryNoise = REFERENCE_NOISE
    range_gain_sigma: float | None = None
    """None: from the sensor's physics."""

    def of(self, setup: Setup) -> Setup:
        """The setup with these physics."""
        return replace(
            setup,
            beam=self.beam or setup.beam,
            odometry_noise=self.odometry_noise,
            range_gain_sigma=self.range_gain_sigma,
        )


@dataclass(frozen=True, slots=True)
class Job:
    """A flight to fly; `mission` is a kind or a mission file."""

    options: FlightOptions
    mission: str = "room"
    settings: Mapping[str, object] = field(default_factory=dict)
    """Overrides of the companion's configuration, after those of the mission."""
    physics: Physics = Physics()

    def prepared(self) -> tuple[Setup, Config, MissionFile]:
        """The simulator's setup, the companion's configuration, and the mission.

        Raises:
            SitlError, CompanionError: an option, a setting or a file is invalid.
        """
        mission = load_mission(self.mission)
        setup, _ = self.options.setup()
        files = {key: file for key, file in mission.sources.items() if key not in self.settings}
        settings = self.options.settings({**mission.settings, **self.settings}, files)
        return self.physics.of(replace(setup, sensors=settings.sensors)), settings, mission

    @property
    def key(self) -> Report:
        """Columns that identify its row."""
        return {
            "world": Path(self.options.world).stem,
            "profile": self.options.profile,
            "autopilot": self.options.autopilot,
            "start": self.options.start or "1",
            "seed": self.options.seed,
            "clutter": self.options.clutter,
        }


@dataclass(frozen=True, slots=True)
class Sketch:
    """Lines to draw, in the world frame, (north, east) in m."""

    truth: Sequence[Segment] = ()
    mapped: Sequence[Segment] = ()
    paths: Sequence[Sequence[Vector2]] = ()
    """The true path of each flight."""
    hits: Sequence[Vector2] = ()
    """Places of collisions."""


@dataclass(frozen=True, slots=True)
class Flown:
    """Result of a flight: the keys of its job and its report, and the times of scan and trace."""

    row: Report
    sketch: Sketch = field(default_factory=Sketch)


def fly(job: Job) -> Flown:
    """Fly; an exception becomes a row of the results."""
    return attempted(job, _fly, lost)


def fly_and_show(
    jobs: Sequence[Job], keep: Callable[[Flown], None] = lambda _: None
) -> list[Flown]:
    """Fly missions with a progress bar on stderr, separate from the printed results.

    `keep` is called after each flight, because a campaign may take hours.
    """

    def progress_text(flown: Flown) -> str:
        keep(flown)
        return ending_in_words(flown)

    return with_a_bar(
        jobs, progress_text, fly, lost, has_failed=lambda flown: not flown.row["completed"]
    )


def ending_in_words(flown: Flown) -> str:
    """One line of progress."""
    row = flown.row
    verdict = "completed" if row["completed"] else f"not completed: {row['ending']}"
    return f"{row['world']} {verdict}"


def lost(job: Job, why: str) -> Flown:
    """The row of a flight without a report."""
    ending = f"lost: {' '.join(why.split())}"
    return Flown({**job.key, "completed": False, "lost": True, "ending": ending})


def _fly(job: Job) -> Flown:
    began_s = time.monotonic()
    setup, settings, mission = job.prepared()
    script, watched = Play(mission.events), Watch()

    def happens(simulation: Simulation, app: App) -> None:
        script(simulation, app)
        watched.tick(app.flight.activity, app.flight.trouble)

    scan = ScanTime()
    app, simulation = fly_in_lockstep(setup, settings, scan.watch, script=happens)
    plan = app.final_floor_plan()
    report = make_report(
        setup,
        settings,
        plan,
        simulation.record,
        outcome=app.flight,
        waited_s=time.monotonic() - began_s,
    )
    truth = wall_surfaces(setup.world, settings.mission.height_m)
    trace_s = watched.trace_s
    seen: Report = {
        "scan_time_s": scan.seconds,
        "trace_time_s": trace_s,
        "trace_over_least": _over_least(trace_s, report, truth),
        "false_alarms": None if mission.events else watched.alarms,
    }
    row = {**report, **job.key, "lost": False, **seen}
    if script.missed:
        row |= {
            "completed": False,
            "ending": f"{row['ending']}, before these events: {script.missed}",
        }
    return Flown(row, _sketch(truth, plan, simulation.record))


class Watch:
    """Counts events in the companion's texts, tick by tick."""

    def __init__(self) -> None:
        self._traced_ticks = 0
        self.alarms = 0
        """Holds because of a range sensor; false alarms if no fault was injected."""
        self._is_alarmed = False

    @property
    def trace_s(self) -> float | None:
        """Time along walls, s; None if there was none."""
        return round(TICK_S * self._traced_ticks, 2) if self._traced_ticks else None

    def tick(self, activity: str, trouble: str) -> None:
        self._traced_ticks += TRACING in activity
        is_alarmed = trouble.startswith(ALARM)
        self.alarms += is_alarmed and not self._is_alarmed
        self._is_alarmed = is_alarmed


def ignore(progress: Progress) -> None:
    """Ignore the progress."""


def _over_least(trace_s: float | None, report: Report, truth: Sequence[Segment]) -> float | None:
    """Time along walls relative to the bound; None unless completed in a room with four walls."""
    least_s = report["least_time_s"]
    if not trace_s or not least_s or not report["completed"] or len(truth) != WALLS_OF_A_ROOM:
        return None
    return round(trace_s / float(least_s), 3)


def _sketch(truth: Sequence[Segment], plan: FloorPlan, record: TruthRecord) -> Sketch:
    """The map placed by the true take-off pose, without alignment."""
    mapped = [
        (in_world(record.take_off, wall.start_ne_m), in_world(record.take_off, wall.end_ne_m))
        for wall in plan.walls
    ]
    path = [state.position_ned_m[:2] for state in record.path]
    return Sketch(truth, mapped, [path], places_of_hits([record]))


def places_of_hits(records: Sequence[TruthRecord]) -> list[Vector2]:
    """Where the vehicles collided, in the world's frame, (north, east) in m."""
    return [place[:2] for record in records for place in record.hits_ned_m]


def in_world(take_off: TrueState, point_ne_m: Vector2) -> Vector2:
    """A point of the map in the world's frame, by the true take-off pose, m."""
    north_m, east_m = frd_to_ned(*point_ne_m, take_off.yaw_rad)
    return take_off.position_ned_m[0] + north_m, take_off.position_ned_m[1] + east_m
