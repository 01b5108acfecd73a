"""Tests of the comparison of teams with one drone."""

import math
from typing import Any

import numpy as np
import pytest

from companion.core.messages import Beam, Hit
from sitl.bench.missions import Flown
from sitl.bench.teams import TeamFlown, sum_up, team_table
from sitl.core.truth import TrueState
from sitl.scoring.coverage_time import first_seen_s, time_to_see_s

START = TrueState(0.0, (2.0, 1.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.5 * math.pi, 0.0)
"""It looks east from 2 m north, 1 m east."""
WALL = np.array([[2.0, 5.0], [3.0, 5.0], [4.0, 5.0]])
"""Samples of a wall 4 m ahead of the start, world frame."""


def hit(ahead_m: float, right_m: float, wall: int | None = 0) -> Hit:
    return Hit(0.0, Beam.FRONT, (ahead_m, right_m, -1.2), 0.01, wall)


def test_each_place_of_a_wall_is_seen_at_the_first_reading_on_it() -> None:
    """The readings are in the frame of the start: to its left is north."""
    hits = [hit(4.0, 0.0, None), hit(4.0, -1.1), hit(3.9, 0.1), hit(4.0, 0.0)]
    seen_s = first_seen_s(hits, [1.0, 7.0, 9.0, 12.0], WALL, START)
    assert seen_s.tolist() == [7.0, 9.0, math.inf]
    assert time_to_see_s(seen_s, 0.3) == 7.0
    assert time_to_see_s(seen_s, 0.6) == 9.0
    assert time_to_see_s(seen_s, 1.0) == math.inf


def test_nothing_is_seen_without_a_wall_on_the_map() -> None:
    assert not np.isfinite(first_seen_s([hit(4.0, 0.0, None)], [1.0], WALL, START)).any()


def team(world: str, **fields: object) -> TeamFlown:
    row: dict[str, Any] = {
        "world": world,
        "lost": False,
        "completed": True,
        "collisions": 0,
        "apart_m": 0.8,
        "coverage": 0.9,
        "scan_ratio": None,
        "coverage_ratio": 0.6,
        "landing_ratio": 0.7,
    }
    return TeamFlown(Flown(row | fields), ({"drone": 1},))


def test_teams_are_summed_up() -> None:
    lost: dict[str, Any] = {"world": "c", "lost": True, "completed": False}
    result = sum_up([team("a"), team("b", coverage_ratio=0.5, apart_m=0.7), TeamFlown(Flown(lost))])
    totals = result["totals"]
    assert (totals["teams"], totals["completed"], totals["lost"]) == (3, 2, 1)
    assert totals["apart_min_m"] == 0.7
    assert totals["coverage_ratio_mean"] == pytest.approx(0.55)
    assert totals["scan_ratio_mean"] is None
    assert result["rows"][0]["rows"] == ({"drone": 1},)
    assert team_table(result).row_count == 3
