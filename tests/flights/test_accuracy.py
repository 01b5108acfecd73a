"""Tests of map and heading accuracy: the benchmark on one flight, and a drifting gyro."""

import math

import pytest

from companion.app import App
from companion.config import settings as configuration
from companion.pdps.flight.state import Phase
from sitl.bench.accuracy import fly, summary
from sitl.simulation.simulation import Setup, Simulation
from sitl.testing import Sitl, at, refuse_arming, watch
from sitl.world.loading import load_world
from tests.worlds import SMALL_ROOM


def test_the_map_error_is_close_to_that_of_an_ideal_solver() -> None:
    sensors = configuration.load(None, {"sensors.profile": "paper"}).sensors
    result = fly(Setup(load_world("room_100"), "room_100", 3, sensors))
    for error in ("wall_error_aligned_cm", "wall_error_cm", "ate_cm"):
        mine, best = float(result.report[error] or 0), float(result.ideal[error] or 0)
        assert 0 < best < 10
        assert mine < best + 3
        assert float(result.dead_reckoned[error] or 0) > mine
    assert result.home_m < 0.3
    (row,) = summary([result])
    assert row["lost"] == 0


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_gyro_drift_while_arming_is_refused_does_not_rotate_the_map(
    sitl: Sitl, autopilot: str
) -> None:
    """ArduCopter once refused arming ("Gyros inconsistent") for 18 s; the map rotated by 2.5°."""
    yaw_deg: list[float] = []

    def note(simulation: Simulation, app: App) -> None:
        if app.estimator is not None and app.flight.phase is Phase.ARM:
            yaw_deg.append(math.degrees(app.estimator.heading.yaw_rad))

    refused = at(0.0, refuse_arming(for_s=25))
    flight = sitl.fly(
        SMALL_ROOM,
        autopilot=autopilot,
        seed=5,
        script=[refused, watch(note)],
        settings={"mission.time_limit_s": 10},
    )
    assert flight.plan.path, "what was flown was forgotten on the ground"
    assert max(map(abs, yaw_deg)) < 0.4
