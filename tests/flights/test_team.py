"""Tests of teams: two drones share the work, keep apart, and bring back one map."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from companion.app import App
from sitl.core.errors import SitlError
from sitl.core.radio import LinkErrors
from sitl.simulation.fleet import Fleet
from sitl.simulation.team_radio import TeamAir
from sitl.testing import Sitl
from tests.worlds import ROOM

ROOMS = "worlds/two_small_rooms.toml"
HUT = """
name = "hut"
height_m = 4.0
walls = [{ points = [[0, 0], [3, 0], [3, 4], [0, 4]], closed = true }]
starts = [{ name = "south of it", position = [-2.0, 1.0] }]
"""
BAD_RADIO = LinkErrors(loss=0.3, jitter_s=0.3)
PARTED_S = 15.0, 75.0
"""From and until when no packet arrives, s."""
MIN_APART_M, MAX_BYTES_PER_S = 0.6, 20_000


def test_two_drones_trace_a_room_in_less_time_than_one(sitl: Sitl) -> None:
    """One drone needs 85 s."""
    team = sitl.fly_team("room_100")
    joint = team.report
    assert joint.completed, joint.ending
    assert joint.flight_time_s < 75
    assert joint.coverage > 0.98
    assert joint.wall_error_aligned_cm < 3
    assert joint.collisions == 0
    assert joint.apart_m > MIN_APART_M
    for row in team.drones:
        assert row.completed, row.ending
        assert row.return_m < 0.3
        assert row.flight_time_s > 30
        assert row.radio_bytes_s < MAX_BYTES_PER_S


def test_equal_seeds_give_equal_flights(sitl: Sitl, tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    path.write_text(ROOM)
    short = {"mission.time_limit_s": 25.0, "mission.reserve_s": 0.0}
    first, second = (sitl.fly_team(str(path), seed=4, settings=short) for _ in range(2))
    assert first.plan.walls
    assert first.plan == second.plan
    assert first.result.rows == second.result.rows


def test_a_bad_radio_costs_time_but_no_safety(sitl: Sitl) -> None:
    """30 % of the packets are lost, the others are late by up to 0.3 s.

    For a minute no packet arrives. The second drone holds its place, and the first keeps off it.
    """
    was_lost = False

    def part(fleet: Fleet, apps: Sequence[App], air: TeamAir) -> None:
        nonlocal was_lost
        is_parted = PARTED_S[0] < fleet.time_s < PARTED_S[1]
        air.reach = lambda sender, receiver: not is_parted
        was_lost |= "not heard" in apps[1].flight.activity

    joint = sitl.fly_team(ROOMS, mission="building", radio=BAD_RADIO, script=part).report
    assert was_lost
    assert joint.completed, joint.ending
    assert joint.collisions == 0
    assert joint.apart_m > MIN_APART_M
    assert joint.coverage > 0.97


def test_two_drones_go_round_a_house_opposite_ways(sitl: Sitl, tmp_path: Path) -> None:
    """They begin south of it. Each sees its own side alone, and both meet in the north.

    The autopilots are PX4; the other tests of this file fly with ArduPilot.
    """
    path = tmp_path / "hut.toml"
    path.write_text(HUT)
    team = sitl.fly_team(str(path), mission="exterior", autopilot="px4")
    joint = team.report
    assert joint.completed, joint.ending
    assert joint.coverage > 0.97
    assert joint.collisions == 0
    assert joint.apart_m > MIN_APART_M


def test_two_drones_divide_the_layers(sitl: Sitl, small: str) -> None:
    """While one explores the lower layer, the other explores the higher one."""
    layers: list[tuple[int, ...]] = []

    def note(fleet: Fleet, apps: Sequence[App], air: TeamAir) -> None:
        layers.append(tuple(app.flight.layers.number for app in apps))

    team = sitl.fly_team(small, mission="layers", script=note)
    joint = team.report
    assert joint.completed, joint.ending
    assert layers.count((0, 1)) > 100
    assert joint.coverage > 0.97
    assert joint.collisions == 0
    assert joint.apart_m > MIN_APART_M


def test_too_many_pads_for_a_room_are_refused(sitl: Sitl) -> None:
    with pytest.raises(SitlError, match=r"room for \d pads near the start"):
        sitl.fly_team(ROOMS, 8, mission="building")


def test_the_other_drone_takes_over_when_one_has_crashed(sitl: Sitl, tmp_path: Path) -> None:
    """The first drone falls silent at the end of its first turn."""
    path = tmp_path / "small.toml"
    path.write_text(ROOM)

    def crash(fleet: Fleet, apps: Sequence[App], air: TeamAir) -> None:
        if fleet.time_s > 20 and fleet.vehicles[0].autopilot.truth.position_ned_m[2] < -0.5:
            fleet.vehicles[0].autopilot.crash("hit by a ball")
            air.reach = lambda sender, receiver: sender != 0

    team = sitl.fly_team(str(path), script=crash)
    crashed, other = team.drones
    assert not crashed.completed
    assert other.completed, other.ending
    assert team.report.coverage > 0.97
