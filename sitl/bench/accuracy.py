"""Measures the accuracy of maps and trajectories at the reference noise, by world and seed.

Each figure is compared with dead reckoning and an ideal solver on the same flights
(`references.py`). The companion's processor time is also measured.
"""

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from companion.app import App
from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.messages import FloorPlan
from companion.earlier import EarlierFlights
from companion.ticks import Inputs, Outputs
from sitl.bench.engine import with_a_bar
from sitl.bench.references import Recorded, dead_reckoned, ideal
from sitl.scoring.report import Report, make_report
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.simulation import Setup, Simulation
from sitl.world.loading import load_world
from sitl.world.plan import wall_surfaces

ROWS = (
    ("room_100", "paper"),
    ("room_100", "gp2y0a710k0f"),
    ("unusual", "gp2y0a710k0f"),
    ("three_room_450", "gp2y0a710k0f"),
    ("office", "gp2y0a710k0f"),
)
"""World and sensor profile of each row."""
MISSIONS = {"three_room_450": "building", "office": "building"}
"""Missions of worlds with several rooms; in the others the room's walls are traced."""
ERRORS = ("wall_error_aligned_cm", "wall_error_cm", "ate_cm")
SCORES = (*ERRORS, "false_walls", "coverage", "wall_sigma_cm", "wall_error_sigmas")
"""Scores in the table, by the keys of the report; `ERRORS` also for the references."""


@dataclass(frozen=True, slots=True)
class FlightResult:
    """One flight: the scores of its map, of dead reckoning and of the ideal solver."""

    world: str
    profile: str
    report: Report
    dead_reckoned: Report
    ideal: Report
    home_m: float
    """Distance of the landing from the start, m."""
    cpu_ms_per_s: float
    """The companion's processor time per second of flight, ms."""
    update_p99_ms: float
    """Processor time of one tick, 99th percentile, ms."""


@dataclass
class TimedApp(App):
    """An `App` that measures its processor time."""

    config: Config
    earlier: EarlierFlights | None = None
    update_s: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(self.config, self.earlier)

    def step(self, now_s: float, inputs: Inputs) -> Outputs:
        began_s = time.process_time()
        outputs = super().step(now_s, inputs)
        self.update_s.append(time.process_time() - began_s)
        return outputs


def fly(setup: Setup) -> FlightResult:
    """Fly one flight; score its map and both references."""
    mission = MISSIONS.get(setup.world_name, "room")
    chosen = {"sensors.profile": setup.sensors.profile, "mission.kind": mission}
    settings = configuration.load(None, chosen)
    apps: list[TimedApp] = []

    def make_app(config: Config) -> App:
        apps.append(TimedApp(config))
        return apps[0]

    began_s = time.monotonic()
    app, simulation = fly_in_lockstep(setup, settings, lambda progress: None, make_app=make_app)
    plan = app.final_floor_plan()
    waited_s = time.monotonic() - began_s

    def report(scored: FloorPlan) -> Report:
        return make_report(
            setup,
            settings,
            scored,
            simulation.record,
            outcome=app.flight,
            waited_s=waited_s,
        )

    dead_reckoning, best = _references(app, simulation, setup, settings, plan)
    start, end = simulation.record.take_off, simulation.record.path[-1]
    update_ms = 1e3 * np.array(apps[0].update_s)
    return FlightResult(
        setup.world_name,
        setup.sensors.profile,
        report(plan),
        report(dead_reckoning),
        report(best),
        home_m=float(np.hypot(*np.subtract(start.position_ned_m, end.position_ned_m)[:2])),
        cpu_ms_per_s=float(update_ms.sum()) / max(simulation.record.air_time_s, 1.0),
        update_p99_ms=float(np.percentile(update_ms, 99)),
    )


def _references(
    app: App, simulation: Simulation, setup: Setup, settings: Config, plan: FloorPlan
) -> tuple[FloorPlan, FloorPlan]:
    """Dead reckoning and ideal solver; empty maps for a flight that never began."""
    if app.estimator is None or len(app.estimator.record.frames) < 2:
        return FloorPlan(path=plan.path), FloorPlan(path=plan.path)
    flown = Recorded(app.estimator.record, app.estimator.models)
    surfaces = wall_surfaces(setup.world, settings.mission.height_m)
    return dead_reckoned(flown, plan), ideal(flown, simulation.record, surfaces)


def fly_all(setups: Sequence[Setup]) -> list[FlightResult]:
    """Fly on all cores with a progress bar; cancelled or crashed flights are left out."""
    flown: list[FlightResult | str] = with_a_bar(setups, _progress_line, fly, _lost)
    return [result for result in flown if isinstance(result, FlightResult)]


def ended(world: str, profile: str, seed: object, ending: object) -> str:
    """One line on a flight and its ending."""
    return f"{world}, {profile}, seed {seed}: {ending}"


def _progress_line(flown: FlightResult | str) -> str:
    if isinstance(flown, str):
        return flown
    report = flown.report
    return ended(flown.world, flown.profile, report["seed"], report["ending"])


def _lost(setup: Setup, why: str) -> str:
    """A line for a flight without figures."""
    return ended(setup.world_name, setup.sensors.profile, setup.seed, f"lost: {why}")


def setups(seeds: int) -> list[Setup]:
    """Setups for each row with seeds 1, 2, ..."""
    loaded = {
        profile: configuration.load(None, {"sensors.profile": profile}).sensors
        for _, profile in ROWS
    }
    return [
        Setup(load_world(world), world, seed, loaded[profile])
        for seed in range(1, seeds + 1)
        for world, profile in ROWS
    ]


Row = dict[str, object]


def summary(results: list[FlightResult]) -> list[Row]:
    """One object per world and profile: means and 95th percentiles over its flights."""
    return [
        _row(mine)
        for world, profile in ROWS
        if (mine := [r for r in results if (r.world, r.profile) == (world, profile)])
    ]


def _row(results: list[FlightResult]) -> Row:
    reports = [result.report for result in results]
    row: Row = {"world": results[0].world, "profile": results[0].profile, "flights": len(results)}
    row |= {score: _mean_and_p95(_values(reports, score)) for score in SCORES}
    for name in ("dead_reckoned", "ideal"):
        others: list[Report] = [asdict(result)[name] for result in results]
        row[name] = {score: _mean_and_p95(_values(others, score)) for score in ERRORS}
    lost = {report["seed"]: report["ending"] for report in reports if not report["completed"]}
    row |= {"lost": len(lost), "lost_by_seed": lost}
    row["collisions"] = sum(_values(reports, "collisions"))
    for figure in ("home_m", "cpu_ms_per_s", "update_p99_ms"):
        row[figure] = _mean_and_p95([getattr(result, figure) for result in results])
    return row


def _values(reports: list[Report], score: str) -> list[float]:
    return [float(value) for report in reports if (value := report[score]) is not None]


def _mean_and_p95(values: list[float]) -> dict[str, float]:
    if not values:
        return {"mean": float("nan"), "p95": float("nan")}
    return {
        "mean": round(float(np.mean(values)), 4),
        "p95": round(float(np.percentile(values, 95)), 4),
    }
