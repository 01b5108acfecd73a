"""Tests of teams: two drones share the work, keep apart, and bring back one map."""

from pathlib import Path

import pytest

from sitl.core.errors import SitlError
from sitl.core.radio import LinkErrors
from sitl.running.options import FlightOptions
from sitl.running.team import TeamResult, scored, team_setups
from sitl.simulation.team import Watch, fly_team_in_lockstep
from sitl.simulation.team_radio import USUAL_ERRORS
from sitl.testing.flight import ReportView
from tests.worlds import ROOM

ROOMS = str(Path(__file__).parent / "worlds" / "two_small_rooms.toml")
BAD_RADIO = LinkErrors(loss=0.3, jitter_s=0.3)
MIN_APART_M, MAX_BYTES_PER_S = 0.6, 20_000


def show_nothing(number: int, progress: object) -> None:
    """Ignore the progress."""


def flown(
    world: str,
    kind: str,
    drones: int = 2,
    *,
    seed: int = 1,
    radio_errors: LinkErrors = USUAL_ERRORS,
    watch: Watch = show_nothing,
) -> TeamResult:
    options = FlightOptions(world, seed, "gp2y0a710k0f", "ardupilot")
    settings = options.settings({"mission.kind": kind})
    setup, _ = options.setup()
    setups, configs = team_setups(setup, settings, drones)
    flight = fly_team_in_lockstep(setups, configs, watch, radio_errors=radio_errors)
    return scored(setup, configs, flight, 1.0)


def test_two_drones_trace_a_room_in_less_time_than_one() -> None:
    """One drone needs 85 s."""
    team = flown("room_100", "room")
    joint = ReportView(team.joint)
    assert joint.completed, joint.ending
    assert joint.flight_time_s < 75
    assert joint.coverage > 0.98
    assert joint.wall_error_aligned_cm < 3
    assert joint.collisions == 0
    assert joint.apart_m > MIN_APART_M
    for row in map(ReportView, team.rows):
        assert row.completed, row.ending
        assert row.return_m < 0.3
        assert row.flight_time_s > 30
        assert row.radio_bytes_s < MAX_BYTES_PER_S


def test_equal_seeds_give_equal_flights(tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    path.write_text(ROOM)
    first, second = (flown(str(path), "room", seed=4) for _ in range(2))
    assert first.merged.plan == second.merged.plan
    assert first.rows == second.rows


def test_a_bad_radio_costs_time_but_no_safety() -> None:
    """30 % of the packets are lost, and the others are late by up to 0.3 s."""
    joint = ReportView(flown(ROOMS, "building", radio_errors=BAD_RADIO).joint)
    assert joint.completed, joint.ending
    assert joint.collisions == 0
    assert joint.apart_m > MIN_APART_M
    assert joint.coverage > 0.97


def test_too_many_pads_for_a_room_are_refused() -> None:
    with pytest.raises(SitlError, match=r"room for \d pads near the start"):
        flown(ROOMS, "building", 8)
