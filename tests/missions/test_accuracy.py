"""The benchmark of accuracy, on one flight."""

from companion import config as configuration
from sitl.bench.accuracy import fly, summary
from sitl.simulation import Setup
from sitl.world.loading import load_world


def test_the_map_is_nearly_as_exact_as_an_ideal_solver_makes_it() -> None:
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
