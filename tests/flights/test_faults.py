"""Tests that each fault in flight ends with its documented reaction (docs/faults.md)."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import pytest

from companion.app import App
from companion.pdps.flight.state import Phase
from sitl.autopilot.ardupilot import LAND, LOITER
from sitl.simulation.simulation import Simulation
from sitl.testing import (
    Action,
    Event,
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
    hang_bus,
    jump_clock,
    jump_odometry,
    link_down,
    lose_flow,
    noisy,
    optional,
    other_rates,
    pilot_mode,
    refuse_arming,
    restart_autopilot,
    saturate_gyro,
    somebody_near,
    starve,
    stick,
    swap,
    unplug,
    watch,
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
boxes = [{ corner = [3.2, 1.7], size = [0.2, 0.2], top_m = 2.6 }]
"""
LEVEL = ("front", "left", "right")
NO_POSITION = "landed: the autopilot reports no position"


def along_a_wall(action: Action) -> Event:
    """Event at the first flight along a wall, at speed."""

    def is_due(simulation: Simulation, app: App) -> bool:
        north_m_s, east_m_s, _ = simulation.autopilot.truth.velocity_ned_m_s
        return "scanning" in app.flight.activity and math.hypot(north_m_s, east_m_s) > 0.4

    return Event(is_due, action)


@pytest.fixture
def small(tmp_path: Path) -> str:
    """A room for a flight of 50 s."""
    path = tmp_path / "small.toml"
    path.write_text(ROOM)
    return str(path)


def phase(flight: Flight) -> Phase:
    return flight.app.flight.phase


def test_the_companion_hands_over_when_the_pilot_takes_over(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, pilot_mode("LOITER"))])
    assert phase(flight) is Phase.HANDED_OVER
    assert flight.ending == "handed over: mode changed to LOITER"
    assert flight.simulation.time_s < 31.5  # HEARTBEAT reports it at once
    assert flight.simulation.autopilot.mode == LOITER
    assert flight.plan.walls


def test_a_link_lost_for_five_seconds_lands_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, link_down(for_s=5))])
    assert phase(flight) is Phase.DONE
    assert flight.ending == "landed: the autopilot is silent"
    assert flight.simulation.autopilot.mode == LAND
    assert flight.truth.collisions == 0
    assert flight.plan.walls


def test_a_short_link_loss_does_not_end_the_mission(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, link_down(for_s=1.8))])
    assert flight.completed, flight.ending


def test_a_permanent_link_loss_ends_the_flight_with_the_drone_at_rest(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, link_down())])
    assert phase(flight) is Phase.FAILED
    assert "no message" in flight.ending
    assert flight.simulation.time_s < 42
    north, east, _ = flight.simulation.autopilot.truth.velocity_ned_m_s
    assert abs(north) + abs(east) < 0.2


def test_a_closed_sensor_bus_lands_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, break_bus())])
    assert phase(flight) is Phase.DONE
    assert "silent" in flight.ending or "failed" in flight.ending
    assert flight.truth.collisions == 0
    assert flight.plan.walls


def test_the_flight_continues_after_a_short_bus_failure(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, break_bus(for_s=0.9))])
    assert flight.completed, flight.ending


@pytest.mark.parametrize("beam", LEVEL)
def test_a_dead_beam_lands_the_drone(sitl: Sitl, beam: str) -> None:
    flight = sitl.fly("room_100", script=[at(30, unplug(beam))])
    assert phase(flight) is Phase.DONE
    assert flight.ending == FAILED + beam
    assert flight.truth.collisions == 0


ON_MCP3008 = "\n".join(
    (
        "[sensors.ranges]",
        *(
            f"{beam} = {{ kind = 'sharp_mcp3008', channel = {channel} }}"
            for channel, beam in enumerate((*LEVEL, "up", "down"))
        ),
    )
)


@pytest.mark.parametrize("beam", LEVEL)
def test_an_open_adc_input_that_follows_its_neighbours_lands_the_drone(
    sitl: Sitl, tmp_path: Path, beam: str
) -> None:
    """The voltage of the open input is always that of a valid distance."""
    config = tmp_path / "drone.toml"
    config.write_text(ON_MCP3008)
    script = [at(30, unplug(beam, memory=0.9))]
    flight = sitl.fly("room_100", config=str(config), script=script)
    assert phase(flight) is Phase.DONE
    assert flight.ending.endswith(beam), flight.ending
    assert flight.simulation.time_s < 42
    assert flight.truth.collisions == 0


@pytest.mark.parametrize("beam", ["front", "left"])
def test_a_dead_beam_of_the_papers_sensor_lands_the_drone(sitl: Sitl, beam: str) -> None:
    flight = sitl.fly("room_100", profile="paper", script=[at(30, unplug(beam))])
    assert flight.ending == FAILED + beam
    assert flight.truth.collisions == 0


@pytest.mark.parametrize(
    ("profile", "autopilot", "transfer_s"),
    [  # every pair of values of two parameters
        ("gp2y0a710k0f", "ardupilot", 0.03),
        ("gp2y0a710k0f", "px4", 1.0),
        ("vl53l1x", "ardupilot", 1.0),
        ("vl53l1x", "px4", 0.03),
        ("tfmini_s", "ardupilot", 0.03),
        ("tfmini_s", "px4", 1.0),
    ],
)
def test_a_hanging_bus_lands_the_drone_and_setpoints_keep_their_rate(
    sitl: Sitl, profile: str, autopilot: str, transfer_s: float
) -> None:
    ticks_s: list[float] = []

    noted = watch(lambda simulation, app: ticks_s.append(simulation.time_s))
    script = [at(30, hang_bus(transfer_s)), noted]
    flight = sitl.fly("room_100", profile=profile, autopilot=autopilot, script=script)
    assert phase(flight) is Phase.DONE
    assert flight.ending == FAILED + "front, left, right"
    assert flight.truth.collisions == 0
    assert max(after - before for before, after in pairwise(ticks_s)) < 0.16


@pytest.mark.parametrize("transfer_s", [0.05, 1.0])
def test_the_flight_continues_after_the_bus_hangs_briefly(
    sitl: Sitl, small: str, transfer_s: float
) -> None:
    flight = sitl.fly(small, script=[at(20, hang_bus(transfer_s, for_s=0.2))])
    assert flight.completed, flight.ending


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
        (link_down(30), "failed: the autopilot is silent; no message for 10 s"),
        (restart_autopilot(), "failed: the autopilot disarmed in the air"),
    ],
)
def test_each_permanent_fault_ends_the_flight_as_documented(
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
def test_swapped_sensors_are_detected_before_a_collision(
    sitl: Sitl, small: str, one: str, other: str, profile: str
) -> None:
    flight = sitl.fly(small, script=[at(0, swap(one, other))], profile=profile)
    assert flight.ending.startswith("landed: range sensors look elsewhere than they should")
    assert flight.truth.collisions == 0


@pytest.mark.parametrize(
    "actions",
    [
        (dead_adc(for_s=0.8), dead_gyro(for_s=0.9), lose_flow(for_s=0.6)),
        (link_down(for_s=0.2), hang(for_s=3), link_down(for_s=1)),
        (
            jump_odometry(north_m=2, east_m=-1, down_m=0.3, yaw_deg=40),
            jump_clock(10),
            jump_clock(-10),
        ),
        (bad_link(loss=0.2),),
        (bad_link(loss=0.2, duplicates=0.2, reordering=0.2, jitter_s=0.3),),
        (other_rates("ATTITUDE", 4), other_rates("LOCAL_POSITION_NED", 10)),
        (other_rates("LOCAL_POSITION_NED", 0),),
    ],
)
def test_temporary_faults_do_not_end_the_mission(
    sitl: Sitl, small: str, actions: Sequence[Action]
) -> None:
    """The faults occur along a wall, in a turn, and on the way back."""
    flight = sitl.fly(small, script=[*map(when, ("scanning", "corner", "returning"), actions)])
    assert flight.completed, flight.ending
    assert len(flight.plan.walls) == 4


@pytest.mark.parametrize("fault", [unplug, stick])
def test_the_flight_continues_without_up_and_down_beam(
    sitl: Sitl, small: str, fault: Callable[[str], Action]
) -> None:
    flight = sitl.fly(small, script=[at(20, fault("up")), at(20, fault("down"))])
    assert flight.completed, flight.ending
    assert len(flight.plan.walls) == 4


@pytest.mark.parametrize(
    ("forward_m", "right_m", "profile"),
    [(0.6, 0.0, "gp2y0a710k0f"), (0.0, -0.5, "gp2y0a710k0f"), (0.6, 0.0, "vl53l1x")],
)
def test_the_drone_keeps_clear_of_a_person_below_the_minimum_range(
    sitl: Sitl, small: str, forward_m: float, right_m: float, profile: str
) -> None:
    comes = along_a_wall(somebody_near(forward_m, right_m, for_s=8))
    flight = sitl.fly(small, script=[comes], profile=profile)
    assert flight.completed, flight.ending
    assert len(flight.plan.walls) == 4


@pytest.mark.parametrize(("forward_m", "right_m"), [(0.9, 0.0), (0.0, 1.2)])
def test_the_drone_stops_before_a_person_who_steps_into_its_way(
    sitl: Sitl, small: str, forward_m: float, right_m: float
) -> None:
    comes = along_a_wall(somebody_near(forward_m, right_m, for_s=8))
    flight = sitl.fly(small, script=[comes])
    assert flight.completed, flight.ending
    assert flight.truth.clearance_m > 0.3


@pytest.mark.parametrize(("north_m_s", "east_m_s"), [(-0.5, 0.0), (0.0, -0.5)])
def test_a_gust_towards_a_wall_causes_no_collision(
    sitl: Sitl, small: str, north_m_s: float, east_m_s: float
) -> None:
    flight = sitl.fly(small, script=[at(20, gust(north_m_s, east_m_s, for_s=3))])
    assert flight.completed, flight.ending
    assert flight.truth.clearance_m > 0.1


def test_the_rest_is_explored_if_the_scan_path_is_blocked(sitl: Sitl, tmp_path: Path) -> None:
    """Some flights pass the post, others do not."""
    path, explored = tmp_path / "blocked.toml", []
    path.write_text(ROOM + POST)

    def note(_: Simulation, app: App) -> None:
        if app.flight.activity == "looking round":
            explored.append(app)

    for seed in (1, 3, 4):
        flight = sitl.fly(str(path), seed=seed, script=[watch(note)])
        assert flight.completed, flight.ending
        assert flight.truth.collisions == 0
        assert flight.report.coverage > 0.9
    assert explored


def test_a_turn_during_a_hang_of_the_companion_does_not_distort_the_map(
    sitl: Sitl, small: str
) -> None:
    flight = sitl.fly(small, script=[when("corner", hang(for_s=3))])
    assert flight.completed, flight.ending
    assert flight.report.wall_error_aligned_cm < 5


STARVED = "the computer is starved: ticks "


def troubles(flown: list[str]) -> Event:
    """Records the companion's trouble text at every tick."""

    def note(simulation: Simulation, app: App) -> None:
        if app.flight.trouble:
            flown.append(app.flight.trouble)

    return watch(note)


@pytest.mark.parametrize(
    ("begins", "profile"),
    [
        (at(20, starve(for_s=5)), "gp2y0a710k0f"),
        (when("corner", starve(for_s=5)), "vl53l1x"),
        (when("corner", starve(for_s=5, between_reads=True)), "gp2y0a710k0f"),
        (when("corner", starve(0.2, 0.6, for_s=6)), "tfmini_s"),
        (at(0, starve(for_s=8)), "gp2y0a710k0f"),
    ],
)
def test_a_starved_computer_holds_the_drone_without_a_sensor_fault(
    sitl: Sitl, small: str, begins: Event, profile: str
) -> None:
    recorded: list[str] = []
    flight = sitl.fly(small, script=[begins, troubles(recorded)], profile=profile)
    assert flight.completed, flight.ending
    assert all(trouble.startswith(STARVED) for trouble in recorded)
    assert flight.report.wall_error_aligned_cm < 3
    assert flight.truth.clearance_m > 0.5


@pytest.mark.parametrize("between_reads", [False, True])
def test_a_permanently_starved_computer_lands_the_drone(
    sitl: Sitl, small: str, between_reads: bool
) -> None:
    recorded: list[str] = []
    begins = when("corner", starve(between_reads=between_reads))
    flight = sitl.fly(small, script=[begins, troubles(recorded)])
    assert flight.ending.startswith("landed: " + STARVED)
    assert all(trouble.startswith(STARVED) for trouble in recorded)
    assert flight.truth.collisions == 0
    assert flight.report.wall_error_aligned_cm < 3


def test_the_drone_does_not_take_off_if_the_computer_is_starved_from_the_start(
    sitl: Sitl, small: str
) -> None:
    flight = sitl.fly(small, script=[at(0, starve())])
    assert flight.ending.startswith("failed: not ready after 60 s: " + STARVED)
    assert not flight.app.flight.took_off


def test_starved_flights_are_identical_over_every_transport(sitl: Sitl, small: str) -> None:
    def path(transport: str) -> object:
        starved = [at(15, starve(for_s=4)), at(25, starve(for_s=4, between_reads=True))]
        script = [*starved, at(35, crash())]
        return sitl.fly(small, script=script, transport=transport).truth.path

    assert path("direct") == path("bytes")


@pytest.mark.parametrize("begins_s", [6.0, 20.0])
@pytest.mark.parametrize("pull_deg", [-14.0, 3.0])
def test_a_heading_correction_of_the_autopilot_is_not_a_gyro_fault(
    sitl: Sitl, small: str, begins_s: float, pull_deg: float
) -> None:
    """The heading shifts by 14° in 3 s, as PX4's at take-off, or by 3° at once, as ArduPilot's."""
    recorded: list[str] = []
    steps = 60 if pull_deg < 0 else 1
    pulls = [at(begins_s + 0.05 * i, jump_odometry(yaw_deg=pull_deg / steps)) for i in range(steps)]
    flight = sitl.fly(small, script=[*pulls, troubles(recorded)])
    assert flight.completed, flight.ending
    assert not recorded
    assert flight.report.wall_error_aligned_cm < 3


@pytest.mark.parametrize(
    ("in_line_s", "in_turn_s"),
    [(-1.9, 0.2), (-1.0, 3.0), (-0.5, -1.9), (-0.2, -1.0), (0.2, -0.5), (3.0, -0.2)],
)
def test_a_step_of_the_autopilots_clock_is_not_a_fault(
    sitl: Sitl, small: str, in_line_s: float, in_turn_s: float
) -> None:
    recorded: list[str] = []
    jumps = [when("scanning", jump_clock(in_line_s)), when("corner", jump_clock(in_turn_s))]
    flight = sitl.fly(small, script=[*jumps, troubles(recorded)])
    assert flight.completed, flight.ending
    assert not recorded
    assert flight.report.wall_error_aligned_cm < 2


def test_the_companion_waits_for_an_autopilot_that_restarts_before_take_off(
    sitl: Sitl, small: str
) -> None:
    flight = sitl.fly(small, script=[at(2, restart_autopilot())])
    assert flight.completed, flight.ending


def test_the_autopilots_gyro_is_usable_after_a_restart_and_a_clock_step(
    sitl: Sitl, small: str
) -> None:
    events = [at(2, restart_autopilot()), at(25, jump_clock(-10))]
    flight = sitl.fly(small, settings={"sensors.gyro": "autopilot"}, script=events)
    assert flight.completed, flight.ending
    assert len(flight.plan.walls) == 4


def test_refused_arming_ends_with_the_autopilots_text(sitl: Sitl, small: str) -> None:
    flight = sitl.fly(small, script=[at(0, refuse_arming())])
    assert flight.ending.startswith("failed: cannot arm after 30 s")
    assert "Compass not calibrated" in flight.ending


def test_the_companion_does_not_resume_control_after_a_handover(sitl: Sitl, small: str) -> None:
    given_back = optional(at(20.5, pilot_mode("GUIDED")))  # the companion has ended before this
    script = [at(20, pilot_mode("LOITER")), given_back]
    flight = sitl.fly(small, script=script)
    assert flight.ending == "handed over: mode changed to LOITER"
