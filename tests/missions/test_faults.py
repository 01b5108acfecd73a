"""What goes wrong in flight, and that each ends in its written reaction (docs/faults.md)."""

from collections.abc import Callable
from pathlib import Path

import pytest

from companion.pdps.flight import Phase
from sitl.autopilot.ardupilot import LAND, LOITER
from sitl.testing import (
    Action,
    Flight,
    Sitl,
    at,
    bad_link,
    battery,
    bias_gyro,
    break_bus,
    crash,
    dead_adc,
    dead_gyro,
    gust,
    hang,
    jump_clock,
    jump_odometry,
    link_down,
    lose_flow,
    noisy,
    other_rates,
    pilot_mode,
    refuse_arming,
    restart_autopilot,
    saturate_gyro,
    somebody_near,
    stick,
    swap,
    unplug,
    when,
)

ROOM = """
name = "small room"
height_m = 2.6
walls = [{ points = [[0, 0], [5, 0], [5, 5.5], [0, 5.5]], closed = true }]
starts = [{ name = "middle", position = [2.5, 2.6] }]
"""
FAILED = "landed: range sensor failed: "
POST = """
boxes = [{ corner = [1.0, 4.4], size = [0.3, 0.3], top_m = 2.6 }]
"""
LEVEL = ("front", "left", "right")
NO_POSITION = "landed: the autopilot tells no position"


@pytest.fixture
def small(tmp_path: Path) -> str:
    """A room that is flown in 50 s."""
    path = tmp_path / "small.toml"
    path.write_text(ROOM)
    return str(path)


def phase(flight: Flight) -> Phase:
    return flight.app.flight.phase


def test_a_pilot_takes_over_and_the_companion_falls_silent(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, pilot_mode("LOITER"))])
    assert phase(flight) is Phase.HANDED_OVER
    assert flight.ending == "handed over: mode changed to LOITER"
    assert flight.simulation.time_s < 31.5  # HEARTBEAT tells it at once
    assert flight.simulation.autopilot.mode == LOITER
    assert flight.plan.walls


def test_a_link_lost_for_five_seconds_lands_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, link_down(for_s=5))])
    assert phase(flight) is Phase.DONE
    assert flight.ending == "landed: the autopilot is silent"
    assert flight.simulation.autopilot.mode == LAND
    assert flight.truth.collisions == 0
    assert flight.plan.walls


def test_a_short_silence_only_holds_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, link_down(for_s=1.8))])
    assert flight.completed, flight.ending


def test_a_link_lost_for_good_is_given_up_with_the_drone_at_rest(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, link_down())])
    assert phase(flight) is Phase.FAILED
    assert "nothing heard" in flight.ending
    assert flight.simulation.time_s < 42
    north, east, _ = flight.simulation.autopilot.truth.velocity_ned_m_s
    assert abs(north) + abs(east) < 0.2


def test_a_closed_sensor_bus_lands_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, break_bus())])
    assert phase(flight) is Phase.DONE
    assert "silent" in flight.ending or "failed" in flight.ending
    assert flight.truth.collisions == 0
    assert flight.plan.walls


def test_a_bus_that_comes_back_lets_the_flight_go_on(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, break_bus(for_s=0.9))])
    assert flight.completed, flight.ending


@pytest.mark.parametrize("beam", LEVEL)
def test_a_dead_beam_lands_the_drone(sitl: Sitl, beam: str) -> None:
    flight = sitl.fly("room_100", script=[at(30, unplug(beam))])
    assert phase(flight) is Phase.DONE
    assert flight.ending == FAILED + beam
    assert flight.truth.collisions == 0


def test_a_crash_fails_the_flight(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, crash())])
    assert phase(flight) is Phase.FAILED
    assert flight.ending == "failed: the autopilot disarmed in the air"


@pytest.mark.parametrize(
    ("action", "ending"),
    [
        *((stick(beam), FAILED + beam) for beam in LEVEL),
        *((noisy(beam), FAILED + beam) for beam in LEVEL),
        (dead_adc(), FAILED + "front, left, right"),
        (dead_gyro(), "landed: the gyro is silent"),
        (saturate_gyro(), "landed: the gyro is saturated"),
        (bias_gyro(5), "landed: gyro and autopilot do not turn alike"),
        (lose_flow(), NO_POSITION),
        (battery(5), "landed: 5 % of the battery is left"),
        (battery(15), "landed: turned back with 15 % of the battery"),
        (link_down(30), "failed: the autopilot is silent; nothing heard for 10 s"),
        (restart_autopilot(), "failed: the autopilot disarmed in the air"),
    ],
)
def test_what_lasts_ends_the_flight_in_its_way(
    sitl: Sitl, small: str, action: Action, ending: str
) -> None:
    flight = sitl.fly(small, script=[at(20, action)])
    assert flight.ending.startswith(ending)
    assert flight.truth.collisions == 0
    assert flight.plan.walls


@pytest.mark.parametrize(
    ("one", "other", "profile"),
    [("left", "right", "vl53l1x"), ("left", "right", "paper"), ("front", "right", "gp2y0a710k0f")],
)
def test_swapped_sensors_show_before_they_do_harm(
    sitl: Sitl, small: str, one: str, other: str, profile: str
) -> None:
    flight = sitl.fly(small, script=[at(0, swap(one, other))], profile=profile)
    assert flight.ending.startswith("landed: range sensors look elsewhere than they should")
    assert flight.truth.collisions == 0


@pytest.mark.parametrize(
    "action",
    [
        dead_adc(for_s=0.8),
        dead_gyro(for_s=0.9),
        link_down(for_s=0.2),
        link_down(for_s=1),
        lose_flow(for_s=0.6),
        jump_odometry(north_m=2, east_m=-1, down_m=0.3, yaw_deg=40),
        jump_clock(10),
        jump_clock(-10),
        hang(for_s=3),
        bad_link(loss=0.2),
        bad_link(loss=0.2, duplicates=0.2, reordering=0.2, jitter_s=0.3),
        other_rates("ATTITUDE", 4),
        other_rates("LOCAL_POSITION_NED", 10),
        other_rates("LOCAL_POSITION_NED", 0),
    ],
)
def test_what_passes_does_not_end_the_mission(sitl: Sitl, small: str, action: Action) -> None:
    flight = sitl.fly(small, script=[at(20, action)])
    assert flight.completed, flight.ending
    assert len(flight.plan.walls) == 4


@pytest.mark.parametrize("fault", [unplug, stick])
def test_without_up_and_down_beam_it_flies_on(
    sitl: Sitl, small: str, fault: Callable[[str], Action]
) -> None:
    flight = sitl.fly(small, script=[at(20, fault("up")), at(20, fault("down"))])
    assert flight.completed, flight.ending
    assert len(flight.plan.walls) == 4


@pytest.mark.parametrize(
    ("forward_m", "right_m", "profile"),
    [(0.6, 0.0, "gp2y0a710k0f"), (0.0, -0.5, "gp2y0a710k0f"), (0.6, 0.0, "vl53l1x")],
)
def test_it_keeps_off_from_who_steps_up_too_near_to_be_measured(
    sitl: Sitl, small: str, forward_m: float, right_m: float, profile: str
) -> None:
    comes = at(20, somebody_near(forward_m, right_m, for_s=8))
    flight = sitl.fly(small, script=[comes], profile=profile)
    assert flight.completed, flight.ending
    assert len(flight.plan.walls) == 4


@pytest.mark.parametrize(("forward_m", "right_m"), [(0.9, 0.0), (0.0, 0.9)])
def test_it_stops_before_who_steps_into_its_way(
    sitl: Sitl, small: str, forward_m: float, right_m: float
) -> None:
    flight = sitl.fly(small, script=[at(20, somebody_near(forward_m, right_m, for_s=8))])
    assert flight.completed, flight.ending
    assert flight.truth.clearance_m > 0.3


@pytest.mark.parametrize(("north_m_s", "east_m_s"), [(-0.5, 0.0), (0.0, -0.5)])
def test_a_gust_towards_a_wall_does_not_throw_it_there(
    sitl: Sitl, small: str, north_m_s: float, east_m_s: float
) -> None:
    flight = sitl.fly(small, script=[at(20, gust(north_m_s, east_m_s, for_s=3))])
    assert flight.completed, flight.ending
    assert flight.truth.clearance_m > 0.1


def test_where_the_trace_cannot_pass_the_rest_is_explored(sitl: Sitl, tmp_path: Path) -> None:
    path, explored = tmp_path / "blocked.toml", []
    path.write_text(ROOM + POST)
    explores = when("looking round", Action(lambda simulation: explored.append(simulation.time_s)))
    flight = sitl.fly(str(path), script=[explores])
    assert flight.completed, flight.ending
    assert explored
    assert flight.report.coverage > 0.9


def test_a_turn_that_a_hanging_companion_has_missed_is_known_all_the_same(
    sitl: Sitl, small: str
) -> None:
    flight = sitl.fly(small, script=[when("corner", hang(for_s=3))])
    assert flight.completed, flight.ending
    assert flight.report.wall_error_aligned_cm < 5


def test_an_autopilot_that_restarts_before_take_off_is_waited_for(sitl: Sitl, small: str) -> None:
    flight = sitl.fly(small, script=[at(2, restart_autopilot())])
    assert flight.completed, flight.ending


def test_an_autopilot_whose_gyro_we_use_may_restart_and_its_clock_jump(
    sitl: Sitl, small: str
) -> None:
    events = [at(2, restart_autopilot()), at(25, jump_clock(-10))]
    flight = sitl.fly(small, settings={"sensors.gyro": "autopilot"}, script=events)
    assert flight.completed, flight.ending
    assert len(flight.plan.walls) == 4


def test_refused_arming_ends_with_the_autopilots_words(sitl: Sitl, small: str) -> None:
    flight = sitl.fly(small, script=[at(0, refuse_arming())])
    assert flight.ending.startswith("failed: cannot arm after 30 s")
    assert "Compass not calibrated" in flight.ending


def test_a_drone_that_is_given_back_is_left_where_it_is(sitl: Sitl, small: str) -> None:
    script = [at(20, pilot_mode("LOITER")), at(20.5, pilot_mode("GUIDED"))]
    flight = sitl.fly(small, script=script)
    assert flight.ending == "handed over: mode changed to LOITER"
