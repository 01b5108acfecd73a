"""Tests that each fault of sensors, link and autopilot ends as documented (docs/faults.md)."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import pytest

from companion.pdps.flight.state import Phase
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
    hang,
    hang_bus,
    jump_clock,
    jump_odometry,
    link_down,
    lose_flow,
    mute,
    noisy,
    optional,
    other_rates,
    pilot_mode,
    refuse_arming,
    restart_autopilot,
    saturate_gyro,
    stick,
    swap,
    unplug,
    watch,
    when,
)

FAILED = "landed: range sensor failed: "
LEVEL = ("front", "left", "right")
NO_POSITION = "landed: the autopilot reports no position"


def phase(flight: Flight) -> Phase:
    return flight.app.flight.phase


def test_the_companion_hands_over_when_the_pilot_takes_over(sitl: Sitl, small: str) -> None:
    flight = sitl.fly(small, script=[at(20, pilot_mode("LOITER"))])
    assert phase(flight) is Phase.HANDED_OVER
    assert flight.ending == "handed over: mode changed to LOITER"
    assert flight.simulation.time_s < 21.5  # HEARTBEAT reports it at once
    assert flight.simulation.autopilot.mode == LOITER
    assert flight.plan.walls


def test_a_link_lost_for_five_seconds_lands_the_drone(sitl: Sitl, small: str) -> None:
    flight = sitl.fly(small, script=[at(20, link_down(for_s=5))])
    assert phase(flight) is Phase.DONE
    assert flight.ending == "landed: the autopilot is silent"
    assert flight.simulation.autopilot.mode == LAND
    assert flight.truth.collisions == 0
    assert flight.plan.walls


def test_a_permanent_link_loss_ends_the_flight_with_the_drone_at_rest(
    sitl: Sitl, small: str
) -> None:
    flight = sitl.fly(small, script=[at(20, link_down())])
    assert phase(flight) is Phase.FAILED
    assert "no message" in flight.ending
    assert flight.simulation.time_s < 32
    north, east, _ = flight.simulation.autopilot.truth.velocity_ned_m_s
    assert abs(north) + abs(east) < 0.2


def test_a_closed_sensor_bus_lands_the_drone(sitl: Sitl, small: str) -> None:
    flight = sitl.fly(small, script=[at(20, break_bus())])
    assert phase(flight) is Phase.DONE
    assert "silent" in flight.ending or "failed" in flight.ending
    assert flight.truth.collisions == 0
    assert flight.plan.walls


@pytest.mark.parametrize("beam", LEVEL)
def test_a_dead_beam_lands_the_drone(sitl: Sitl, small: str, beam: str) -> None:
    flight = sitl.fly(small, script=[at(20, unplug(beam))])
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
    sitl: Sitl, small: str, tmp_path: Path, beam: str
) -> None:
    """The voltage of the open input is always that of a valid distance."""
    config = tmp_path / "drone.toml"
    config.write_text(ON_MCP3008)
    script = [at(20, unplug(beam, memory=0.9))]
    flight = sitl.fly(small, config=str(config), script=script)
    assert phase(flight) is Phase.DONE
    assert flight.ending.endswith(beam), flight.ending
    assert flight.simulation.time_s < 32
    assert flight.truth.collisions == 0


@pytest.mark.parametrize("beam", ["front", "left"])
def test_a_dead_beam_of_the_papers_sensor_lands_the_drone(
    sitl: Sitl, small: str, beam: str
) -> None:
    flight = sitl.fly(small, profile="paper", script=[at(20, unplug(beam))])
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
    sitl: Sitl, small: str, profile: str, autopilot: str, transfer_s: float
) -> None:
    ticks_s: list[float] = []

    noted = watch(lambda simulation, app: ticks_s.append(simulation.time_s))
    script = [at(20, hang_bus(transfer_s)), noted]
    flight = sitl.fly(small, profile=profile, autopilot=autopilot, script=script)
    assert phase(flight) is Phase.DONE
    assert flight.ending == FAILED + "front, left, right"
    assert flight.truth.collisions == 0
    assert max(after - before for before, after in pairwise(ticks_s)) < 0.16


def test_a_crash_fails_the_flight(sitl: Sitl, small: str) -> None:
    flight = sitl.fly(small, script=[at(20, crash())])
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
        (link_down(for_s=0.2), hang(for_s=3), link_down(for_s=1.8)),
        (hang_bus(1.0, for_s=0.2), hang_bus(0.05, for_s=0.2), break_bus(for_s=0.9)),
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


@pytest.mark.parametrize(
    ("fault", "time_s", "words"),
    [
        (unplug("left"), 1, "not ready after 60 s: range sensor failed: left"),
        (dead_gyro(), 1, "not ready after 60 s: the gyro is silent"),
        (mute("ATTITUDE"), 1, "not ready after 60 s: it does not send ATTITUDE"),
        (dead_gyro(), 4, "not armed: the gyro is silent"),
    ],
)
def test_the_drone_does_not_take_off_with_a_fault(
    sitl: Sitl, small: str, fault: Action, time_s: float, words: str
) -> None:
    flight = sitl.fly(small, script=[at(time_s, fault)])
    assert flight.ending == f"failed: {words}"
    assert not flight.app.flight.took_off


def test_refused_arming_ends_with_the_autopilots_text(sitl: Sitl, small: str) -> None:
    flight = sitl.fly(small, script=[at(0, refuse_arming())])
    assert flight.ending.startswith("failed: cannot arm after 30 s")
    assert "Compass not calibrated" in flight.ending


def test_the_companion_does_not_resume_control_after_a_handover(sitl: Sitl, small: str) -> None:
    given_back = optional(at(20.5, pilot_mode("GUIDED")))  # the companion has ended before this
    script = [at(20, pilot_mode("LOITER")), given_back]
    flight = sitl.fly(small, script=script)
    assert flight.ending == "handed over: mode changed to LOITER"
