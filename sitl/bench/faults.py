"""Flies with faults; checks that every flight ends safely and keeps its map."""

import math
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from companion.app import App
from companion.config import settings as configuration
from companion.core.errors import OutputError
from companion.export.map_files import AutoSave, load_json, save_as, save_json
from companion.pdps.flight.state import FINAL_PHASES, Phase
from companion.ticks import Progress
from sitl.bench.engine import attempted
from sitl.bench.fault_cases import Case, draw_case
from sitl.scoring.report import Report
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.simulation import Setup, Simulation
from sitl.testing.script import Play

TIME_LIMIT_S = 150.0
"""The mission's time limit, s. Chosen."""
MAX_TIME_S = 400.0
"""A longer flight counts as endless, s. Chosen."""
SETTLES_S = 10.0
"""Time after which a drone in permanent trouble must be at rest or under the pilot's control, s."""
AFTERWARDS_S = 12.0
"""Time simulated after the end of the flight, s."""
AT_REST_M_S = 0.3
"""Horizontal speed below which the drone counts as at rest, m/s. Chosen."""
TROUBLED = frozenset({Phase.HOLD, Phase.LAND, *FINAL_PHASES})
ENOUGH_HITS = 100
"""Range readings from which a map is expected. Chosen."""


Summary = dict[str, Any]


class EndlessFlightError(Exception):
    """The flight should have ended long ago."""


@dataclass(frozen=True, slots=True)
class FaultJob:
    """A flight to fly: the campaign's seed, and its number in it."""

    seed: int
    number: int


@dataclass(frozen=True, slots=True)
class FaultFlown:
    """Result of a flight."""

    row: Report


class SafetyMonitor:
    """Monitors a flight, tick by tick."""

    def __init__(self) -> None:
        self.collisions_caused = 0
        """Collisions while the companion controlled the drone."""
        self.set_down = 0
        """Vertical landings on furniture, which an immediate landing cannot avoid."""
        self.flies_away = False
        self._collisions = 0
        self._troubled_since_s: float | None = None

    def watch(self, simulation: Simulation, app: App) -> None:
        """Check one tick, also after the end of the flight."""
        now_s, phase = simulation.time_s, app.flight.phase
        if now_s > MAX_TIME_S:
            raise EndlessFlightError(f"still {app.flight.activity} after {now_s:.0f} s")
        hit = simulation.record.collisions > self._collisions
        self._collisions = simulation.record.collisions
        north_m_s, east_m_s, _ = simulation.autopilot.truth.velocity_ned_m_s
        speed_m_s = math.hypot(north_m_s, east_m_s)
        sinks = phase is Phase.LAND and speed_m_s < AT_REST_M_S
        self.set_down += hit and sinks
        self.collisions_caused += hit and not sinks and phase not in FINAL_PHASES
        if phase not in TROUBLED:
            self._troubled_since_s = None
            return
        if self._troubled_since_s is None:
            self._troubled_since_s = now_s
        moves = speed_m_s > AT_REST_M_S
        self.flies_away |= moves and now_s - self._troubled_since_s > SETTLES_S


def fly(job: FaultJob) -> FaultFlown:
    """Fly; an exception becomes a row of the results."""
    return attempted(job, _flown, lost)


def _flown(job: FaultJob) -> FaultFlown:
    case = draw_case(job.seed, job.number)
    with tempfile.TemporaryDirectory() as folder:
        return FaultFlown({**_key(case), **_fly(case, Path(folder))})


def lost(job: FaultJob, why: str) -> FaultFlown:
    """The row of a flight without an end: the drone's position is unknown."""
    bad = {"collisions": 0, "fly_away": True, "map_lost": True}
    ending = f"lost: {' '.join(why.split())}"
    return FaultFlown({**_key(draw_case(job.seed, job.number)), "ending": ending, **bad})


def _key(case: Case) -> Report:
    return {
        "number": case.number,
        "fault": case.faults[0].name,
        "injected": "; ".join(map(str, case.faults)),
        "world": case.world.name,
        "profile": case.profile,
        "autopilot": case.autopilot,
    }


def _fly(case: Case, folder: Path) -> Report:
    settings = configuration.load(
        None, {"sensors.profile": case.profile, "mission.time_limit_s": TIME_LIMIT_S}
    )
    setup = Setup(case.world, case.world.name, case.number, settings.sensors, case.autopilot)
    inject, monitor = Play([fault.event() for fault in case.faults]), SafetyMonitor()
    savers: list[AutoSave] = []

    def script(simulation: Simulation, app: App) -> None:
        if not savers:
            savers.append(AutoSave(folder, app.floor_plan, _ignore))
        inject(simulation, app)
        monitor.watch(simulation, app)

    def save_now_and_then(progress: Progress) -> None:
        for saver in savers:
            saver.update(progress.time_s)

    began_s = time.monotonic()
    app, simulation = fly_in_lockstep(setup, settings, save_now_and_then, script=script)
    for saver in savers:
        saver.settle()
    ended_s = simulation.time_s
    while simulation.time_s < ended_s + AFTERWARDS_S:
        simulation.advance(simulation.time_s + 0.05)
        monitor.watch(simulation, app)
    return {
        "ending": app.flight.ending,
        "phase": app.flight.phase.name,
        "completed": app.flight.completed,
        "flight_s": round(ended_s, 1),
        "collisions": monitor.collisions_caused,
        "set_down_on_furniture": monitor.set_down,
        "collisions_in_all": simulation.record.collisions,
        "clearance_m": round(simulation.record.clearance_m, 2),
        "fly_away": monitor.flies_away,
        "map_lost": _is_map_lost(app, folder / "map.json"),
        "waited_s": round(time.monotonic() - began_s, 1),
    }


def _is_map_lost(app: App, path: Path) -> bool:
    """The flight measured something that its map file does not contain."""
    if app.estimator is None or len(app.estimator.record.hits) < ENOUGH_HITS:
        return False
    try:
        save_as(save_json, app.final_floor_plan(), path)
        plan = load_json(path)
    except (OutputError, OSError, ValueError):
        return True
    return not plan.path or (not plan.walls and bool(app.floor_plan().walls))


def _ignore(warning: str) -> None:
    """Ignore warnings about a temporary folder."""


def sum_up(seed: int, rows: Sequence[Report]) -> Summary:
    """All figures, a row per fault, and the failed flights."""
    names = list(dict.fromkeys(str(row["fault"]) for row in rows))
    return {
        "seed": seed,
        **_figures(rows),
        "faults": [
            {"fault": name, **_figures([row for row in rows if row["fault"] == name])}
            for name in names
        ],
        "wrong": [row for row in rows if is_wrong(row)],
    }


def is_wrong(row: Report) -> bool:
    return bool(row["collisions"] or row["fly_away"] or row["map_lost"])


def _figures(rows: Sequence[Report]) -> Summary:
    phases = Counter(row.get("phase", "") for row in rows)
    completed = sum(bool(row.get("completed")) for row in rows)
    return {
        "flights": len(rows),
        "collisions": sum(int(row["collisions"] or 0) for row in rows),
        "fly_aways": sum(bool(row["fly_away"]) for row in rows),
        "maps_lost": sum(bool(row["map_lost"]) for row in rows),
        "set_down_on_furniture": sum(int(row.get("set_down_on_furniture") or 0) for row in rows),
        "completed": completed,
        "landed": phases["DONE"] - completed,
        "handed_over": phases["HANDED_OVER"],
        "failed": phases["FAILED"],
    }
