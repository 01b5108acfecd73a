"""Draws a map before and after loop closure.

Command: `python -m benchmarks.mapping.loop_figure [--out FILE]`.

The same flight three times, over the true walls: from odometry and gyro alone; the companion's map
on the last leg, before the first wall is detected again; and at the end. Prints the wall errors.
"""

import argparse
from collections import deque
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes

from companion.app import App
from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.messages import FloorPlan
from companion.safety.health.lateness import TICK_S
from companion.ticks import Inputs, Outputs
from sitl.bench.references import Recorded, dead_reckoned, to_local
from sitl.scoring.report import make_report
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup
from sitl.world.loading import load_world
from sitl.world.plan import wall_surfaces

matplotlib.use("Agg")
from matplotlib import pyplot as plt

WORLD, PROFILE, SEED = "room_200", "gp2y0a710k0f", 3
LAST_LEG_CORNERS = 3
BEFORE_THE_CORNER_S = 8.0
"""Time before the last corner at which the first wall is not in range yet, s."""


class Watched(App):
    """An `App` that keeps the maps of the first round's last leg, one per tick."""

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self.maps: deque[FloorPlan] = deque(maxlen=round(BEFORE_THE_CORNER_S / TICK_S))

    def step(self, now_s: float, inputs: Inputs) -> Outputs:
        if self.flight.room.corners == LAST_LEG_CORNERS:
            self.maps.append(self.floor_plan())
        return super().step(now_s, inputs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/loop.png"))
    options = parser.parse_args()
    settings = configuration.load(None, {"sensors.profile": PROFILE})
    setup = Setup(load_world(WORLD), WORLD, SEED, settings.sensors)
    app, simulation = fly_in_lockstep(setup, settings, lambda progress: None, make_app=Watched)
    assert isinstance(app, Watched)
    assert app.estimator is not None
    final = app.final_floor_plan()
    alone = dead_reckoned(Recorded(app.estimator.record, app.estimator.models), final)
    plans = {
        "by odometry and gyro alone": alone,
        "before the loop is closed": app.maps[0],
        "at the end": final,
    }
    figure, panels = plt.subplots(1, 3, figsize=(15, 5.5), sharex=True, sharey=True)
    for axes, (title, plan) in zip(panels, plans.items(), strict=True):
        report = make_report(
            setup,
            settings,
            plan,
            simulation.record,
            outcome=app.flight,
            waited_s=1.0,
        )
        error = f"walls off by {report['wall_error_aligned_cm']:.1f} cm"
        print(f"{title}: {error}")
        draw(axes, plan, simulation.record, setup)
        axes.set_title(f"{title}\n{error}")
    options.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.out, dpi=80, bbox_inches="tight")
    print(f"wrote {options.out}")


def draw(axes: Axes, plan: FloorPlan, truth: TruthRecord, setup: Setup) -> None:
    """Draw a map, east to the right, north up; true walls in grey."""
    axes.set_aspect("equal")
    axes.set_axis_off()
    for surface in wall_surfaces(setup.world, 1.2):
        north, east = to_local(np.array(surface), truth).T
        axes.plot(east, north, color="0.7", linewidth=5, solid_capstyle="round")
    hits = np.array([hit.position_ned_m[:2] for hit in plan.hits])
    axes.scatter(hits[:, 1], hits[:, 0], s=2, color="#e07a1f", alpha=0.3, linewidths=0)
    axes.plot([p.east_m for p in plan.path], [p.north_m for p in plan.path], color="#3a86c8")
    for wall in plan.walls:
        (north_a, east_a), (north_b, east_b) = wall.start_ne_m, wall.end_ne_m
        axes.plot([east_a, east_b], [north_a, north_b], color="#22333b", linewidth=1.5)


if __name__ == "__main__":
    main()
