"""Tests that a survey goes on with a mission over several heights."""

import numpy as np
import pytest

from companion.config import settings
from companion.config.settings import Config
from companion.earlier import EarlierFlights
from companion.survey.left import left_to_fly
from sitl.running.sorties import PAD, Sorties
from sitl.sensors.beam import RAY
from sitl.simulation.simulation import Setup
from sitl.testing.flight import ReportView
from sitl.world.format import Walls, World

pytestmark = pytest.mark.flights

BATTERY_S = 58.0
"""Enough for one layer."""
WORLD = World(
    name="two layers",
    height_m=2.8,
    walls=(
        Walls(points=((0, 0), (5, 0), (5, 4.4), (0, 4.4)), closed=True),
        Walls(points=((3.2, 0), (3.2, 1.5)), top_m=1.5),
    ),
    starts=({"name": "pad", "position": (1.4, 2.4), "heading_deg": 20},),
)
"""A room with a partition that ends below the second layer."""


def settings_of(battery_s: float) -> Config:
    limits = {"mission.time_limit_s": battery_s, "mission.clearance_m": 0.2}
    return settings.load(None, {"mission.kind": "layers", **limits})


def sorties_of(battery_s: float) -> Sorties:
    config = settings_of(battery_s)
    setup = Setup(WORLD, "two layers", 3, config.sensors, beam=RAY, battery_s=battery_s)
    return Sorties(setup, config, lambda _: None, tell=print)


def test_later_flights_go_on_in_the_layer_that_is_left() -> None:
    """The partition stays in the map, although the higher layer sees over it."""
    config = settings_of(BATTERY_S)
    flown = list(sorties_of(BATTERY_S).fly(4))
    rows = [row for each in flown for row in each.rows]
    assert not rows[0]["completed"]
    assert rows[-1]["completed"], [row["ending"] for row in rows]
    first, last = (each.merged.for_next_flight(PAD.sigma) for each in (flown[0], flown[-1]))
    assert left_to_fly(first, config).in_words() == "left: the layers above"
    assert left_to_fly(last, config).is_nothing
    joint = ReportView(flown[-1].joint)
    assert joint.collisions == 0
    assert joint.coverage > 0.95
    assert not flown[-1].merged.changes
    lengths_m = [wall.length_m for wall in flown[-1].merged.plan.walls]
    assert sum(length_m == pytest.approx(1.5, abs=0.2) for length_m in lengths_m) == 1

    read_again = EarlierFlights.from_bytes(last.to_bytes())
    assert [space.free.sum() for space in read_again.spaces] == [
        space.free.sum() for space in last.spaces
    ]
    assert len(read_again.spaces) == 2
    assert read_again.viewpoints == last.viewpoints
    assert np.array_equal(read_again.overhead, last.overhead)


def test_no_layer_is_flown_for_which_the_ceiling_is_too_low() -> None:
    """A third layer would be 0.4 m below the ceiling.

    At 0.3 m, the up beam reads 1.7 m. A drone climbed against the ceiling.
    """
    sorties = sorties_of(66.0)
    flown = list(sorties.fly(4))
    assert flown[-1].rows[-1]["completed"]
    assert flown[-1].joint["collisions"] == 0
    highest_m = max(-state.position_ned_m[2] for each in sorties.truths for state in each.path)
    assert highest_m < 2.0
