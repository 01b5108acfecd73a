"""Tests of flights with people, gusts, a slow computer, or a changed heading or clock."""

import math
from pathlib import Path

import pytest

from companion.app import App
from sitl.simulation.simulation import Simulation
from sitl.testing import (
    Action,
    Event,
    Sitl,
    at,
    crash,
    gust,
    hang,
    jump_clock,
    jump_odometry,
    somebody_near,
    starve,
    watch,
    when,
)
from tests.worlds import ROOM

POST = """
boxes = [{ corner = [3.2, 1.7], size = [0.2, 0.2], top_m = 2.6 }]
"""


def after_corners(
    corners: int, action: Action, activity: str = "scanning", min_speed_m_s: float = 0.0
) -> Event:
    """Event in this activity after that many corners, from that speed."""
    activities: list[str] = []

    def is_due(simulation: Simulation, app: App) -> bool:
        if not activities or activities[-1] != app.flight.activity:
            activities.append(app.flight.activity)
        turned = sum("corner" in earlier for earlier in activities[:-1])
        north_m_s, east_m_s, _ = simulation.autopilot.truth.velocity_ned_m_s
        is_fast = math.hypot(north_m_s, east_m_s) >= min_speed_m_s
        return turned >= corners and is_fast and activity in app.flight.activity

    return Event(is_due, action)


@pytest.mark.parametrize(
    ("offsets_frd_m", "profile"),
    [([(0.0, -0.5), (0.6, 0.0)], "gp2y0a710k0f"), ([(0.6, 0.0)], "vl53l1x")],
)
def test_the_drone_keeps_clear_of_a_person_below_the_minimum_range(
    sitl: Sitl, small: str, offsets_frd_m: list[tuple[float, float]], profile: str
) -> None:
    flight = sitl.fly(small, script=persons(offsets_frd_m), profile=profile)
    assert flight.completed, flight.ending
    assert len(flight.plan.walls) == 4


def test_the_drone_stops_before_a_person_who_steps_into_its_way(sitl: Sitl, small: str) -> None:
    flight = sitl.fly(small, script=persons([(0.9, 0.0), (0.0, 1.2)]))
    assert flight.completed, flight.ending
    assert flight.truth.clearance_m > 0.3


def persons(offsets_frd_m: list[tuple[float, float]]) -> list[Event]:
    """A person along each of the first walls, forward and right of the drone, m."""
    return [
        after_corners(wall, somebody_near(forward_m, right_m, for_s=8), min_speed_m_s=0.4)
        for wall, (forward_m, right_m) in enumerate(offsets_frd_m)
    ]


def test_gusts_towards_walls_cause_no_collision(sitl: Sitl, small: str) -> None:
    gusts = [at(20, gust(-0.5, 0.0, for_s=3)), at(35, gust(0.0, -0.5, for_s=3))]
    flight = sitl.fly(small, script=gusts)
    assert flight.completed, flight.ending
    assert flight.truth.clearance_m > 0.1


def test_the_rest_is_explored_if_the_scan_path_is_blocked(sitl: Sitl, tmp_path: Path) -> None:
    """Some flights pass the post, others do not."""
    path, explored = tmp_path / "blocked.toml", []
    path.write_text(ROOM + POST)

    def note(_: Simulation, app: App) -> None:
        if app.flight.activity == "looking round":
            explored.append(app)

    for seed in (1, 3):
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


@pytest.mark.parametrize(("slow_at_s", "at_once_at_s"), [(6.0, 20.0), (20.0, 6.0)])
def test_a_heading_correction_of_the_autopilot_is_not_a_gyro_fault(
    sitl: Sitl, small: str, slow_at_s: float, at_once_at_s: float
) -> None:
    """The heading shifts by 14° in 3 s, as PX4's at take-off, and by 3° at once, as ArduPilot's."""
    recorded: list[str] = []
    slow = [at(slow_at_s + 0.05 * i, jump_odometry(yaw_deg=-14 / 60)) for i in range(60)]
    pulls = [*slow, at(at_once_at_s, jump_odometry(yaw_deg=3))]
    flight = sitl.fly(small, script=[*pulls, troubles(recorded)])
    assert flight.completed, flight.ending
    assert not recorded
    assert flight.report.wall_error_aligned_cm < 3


@pytest.mark.parametrize(
    ("in_line_s", "in_turn_s"),
    [((-1.9, -1.0, -0.5), (0.2, 3.0, -1.9)), ((-0.2, 0.2, 3.0), (-1.0, -0.5, -0.2))],
)
def test_a_step_of_the_autopilots_clock_is_not_a_fault(
    sitl: Sitl, small: str, in_line_s: tuple[float, ...], in_turn_s: tuple[float, ...]
) -> None:
    """The clock steps along each of three walls, and in each corner after them."""
    recorded: list[str] = []
    jumps = [
        after_corners(wall, jump_clock(step_s), activity)
        for activity, steps_s in (("scanning", in_line_s), ("corner", in_turn_s))
        for wall, step_s in enumerate(steps_s)
    ]
    flight = sitl.fly(small, script=[*jumps, troubles(recorded)])
    assert flight.completed, flight.ending
    assert not recorded
    assert flight.report.wall_error_aligned_cm < 2
