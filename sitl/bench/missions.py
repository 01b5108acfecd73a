"""One of many missions: flown, scored, and sketched, whatever happens to it."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from companion.app import App, Progress
from companion.core.frames import Vector2, frd_to_ned
from companion.core.messages import FloorPlan
from companion.pdps.room_scan_state import ScanPhase
from companion.safety.health.lateness import TICK_S
from sitl.running.options import FlightOptions
from sitl.scoring.report import Report, make_report
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Simulation
from sitl.testing.mission_file import load_mission
from sitl.testing.script import Play
from sitl.world.format import Segment
from sitl.world.plan import wall_surfaces

TRACING = ScanPhase.SCAN.value
"""What the companion says that it does while it traces walls; not while it turns, nor when it goes
round once more."""
ALARM = "range sensor failed"
"""So begins the trouble that the companion tells; `companion/safety/health/watch.py`."""
WALLS_OF_A_ROOM = 4
"""And nothing else: then the bound (P - 8·d) / v applies."""


@dataclass(frozen=True, slots=True)
class Job:
    """A flight to be flown; `mission` is a kind or a mission file."""

    options: FlightOptions
    mission: str = "room"

    @property
    def key(self) -> Report:
        """What tells its row from all others."""
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
    """What there is to draw, in the world's frame, (north, east) in metres."""

    truth: Sequence[Segment] = ()
    mapped: Sequence[Segment] = ()
    path: Sequence[Vector2] = ()


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight that has ended: the keys of its job and of its report, and the trace's time."""

    row: Report
    sketch: Sketch = field(default_factory=Sketch)


def fly(job: Job) -> Flown:
    """Fly; a flight that breaks off by an error is a row that tells it."""
    try:
        return _fly(job)
    except Exception as error:  # one flight of hundreds must not end the others
        return lost(job, f"{type(error).__name__}: {error}")


def lost(job: Job, why: str) -> Flown:
    """A flight that has no report."""
    ending = f"lost: {' '.join(why.split())}"
    return Flown({**job.key, "completed": False, "lost": True, "ending": ending})


def _fly(job: Job) -> Flown:
    began_s = time.monotonic()
    setup, _ = job.options.setup()
    mission = load_mission(job.mission)
    settings, script = job.options.settings(mission.settings), Play(mission.events)
    watched = Watch()

    def happens(simulation: Simulation, app: App) -> None:
        script(simulation, app)
        watched.tick(app.flight.activity, app.flight.trouble)

    app, simulation = fly_in_lockstep(setup, settings, _nobody_looks, script=happens)
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
    """What a flight tells, tick by tick."""

    def __init__(self) -> None:
        self._traced_ticks = 0
        self.alarms = 0
        """How often it held for a range sensor; each is false where none was broken."""
        self._is_alarmed = False

    @property
    def trace_s(self) -> float | None:
        """Time along walls, if there was any."""
        return round(TICK_S * self._traced_ticks, 2) if self._traced_ticks else None

    def tick(self, activity: str, trouble: str) -> None:
        self._traced_ticks += TRACING in activity
        is_alarmed = trouble.startswith(ALARM)
        self.alarms += is_alarmed and not self._is_alarmed
        self._is_alarmed = is_alarmed


def _nobody_looks(progress: Progress) -> None:
    """Of so many flights."""


def _over_least(trace_s: float | None, report: Report, truth: Sequence[Segment]) -> float | None:
    """Time without turns against the bound, of a completed flight in a room that it holds for."""
    least_s = report["least_time_s"]
    if not trace_s or not least_s or not report["completed"] or len(truth) != WALLS_OF_A_ROOM:
        return None
    return round(trace_s / float(least_s), 3)


def _sketch(truth: Sequence[Segment], plan: FloorPlan, record: TruthRecord) -> Sketch:
    """The map goes where take-off truly was; it is not aligned."""
    take_off = record.take_off

    def in_world(point: Vector2) -> Vector2:
        north_m, east_m = frd_to_ned(*point, take_off.yaw_rad)
        return take_off.position_ned_m[0] + north_m, take_off.position_ned_m[1] + east_m

    mapped = [(in_world(wall.start_ne_m), in_world(wall.end_ne_m)) for wall in plan.walls]
    return Sketch(truth, mapped, [state.position_ned_m[:2] for state in record.path])
