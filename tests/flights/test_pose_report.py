"""Tests of the pose sent to the autopilot: the autopilot's estimate no longer drifts."""

import math

import pytest

from companion.app import App
from companion.config import settings as configuration
from companion.core.frames import Vector2
from companion.core.messages import Pose
from companion.pdps.flight.state import Phase
from companion.safety.health.lateness import TICK_S
from sitl.scoring.score import score_trajectory
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.simulation import Setup, Simulation
from sitl.world.loading import load_world

TAKES_POSITION_AND_YAW = {
    "ardupilot": {"EK3_SRC1_POSXY": 6.0, "EK3_SRC1_YAW": 6.0, "VISO_TYPE": 1.0},
    "px4": {"EKF2_EV_CTRL": 9.0},
}
ON_ITS_WAY_M_S = 0.4
"""Speed from which the drone flies along a wall at its final speed, m/s."""


def ate_m(autopilot: str, seed: int, *, send_pose: bool) -> float:
    """ATE of the autopilot's own estimate on a flight around a room, rigidly aligned, m."""
    settings = configuration.load(
        None, {"sensors.profile": "paper", "link.send_pose": send_pose, "mission.speed_m_s": 1.0}
    )
    parameters = TAKES_POSITION_AND_YAW[autopilot] if send_pose else {}
    world = load_world("room_100")
    setup = Setup(world, "room_100", seed, settings.sensors, autopilot, parameters)
    estimated: list[Pose] = []

    def note(simulation: Simulation, app: App) -> None:
        if app.flight.took_off:
            state = simulation.autopilot.estimate
            estimated.append(Pose(simulation.time_s, *state.position_ned_m, state.yaw_rad))

    app, simulation = fly_in_lockstep(setup, settings, lambda progress: None, script=note)
    assert app.flight.completed
    assert simulation.record.collisions == 0
    if send_pose:
        off_deg = math.degrees(estimated[-1].yaw_rad - simulation.autopilot.truth.yaw_rad)
        assert abs(math.remainder(off_deg, 360)) < 15  # the compass error at the start
    truth = simulation.record
    return score_trajectory(estimated[::10], truth.path, truth.take_off).ate_cm / 100


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_the_companions_pose_improves_the_autopilots_estimate(autopilot: str) -> None:
    with_pose_m = [ate_m(autopilot, seed, send_pose=True) for seed in (1, 2)]
    assert max(with_pose_m) < 0.15
    assert ate_m(autopilot, 1, send_pose=False) > 2 * with_pose_m[0]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_take_off_is_refused_if_the_autopilot_ignores_the_companions_pose(
    autopilot: str,
) -> None:
    settings = configuration.load(None, {"sensors.profile": "paper", "link.send_pose": True})
    name = next(iter(TAKES_POSITION_AND_YAW[autopilot]))
    setup = Setup(load_world("room_100"), "room_100", 1, settings.sensors, autopilot)
    app, simulation = fly_in_lockstep(setup, settings, lambda progress: None)
    assert not app.flight.took_off
    assert f"{name} is 0, set it to" in app.flight.trouble
    assert simulation.record.collisions == 0


@pytest.mark.parametrize("rate_m_s2", [1.0, 2.5])
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_fly_away_is_detected_and_stopped(autopilot: str, rate_m_s2: float) -> None:
    """The drone accelerates to 5 m/s in 2 s, as after repeated resets of the position.

    The acceleration is in the direction of flight. In the opposite direction the drone would first
    stop, which is no fly-away. PX4's reported velocity errs by 0.1 m/s for a second, which is 0.1 s
    at 1 m/s².
    """
    began: list[tuple[float, Vector2]] = []
    noticed_s: list[float] = []

    def fly_away(simulation: Simulation, app: App) -> None:
        autopilot, speed_m_s = simulation.autopilot, math.hypot(*velocity_ne_m_s(simulation))
        if not began and "scanning" in app.flight.activity and speed_m_s > ON_ITS_WAY_M_S:
            north, east = velocity_ne_m_s(simulation)
            began.append((simulation.time_s, (north / speed_m_s, east / speed_m_s)))
        if not began or noticed_s:
            return
        began_s, (north, east) = began[0]
        away_s = simulation.time_s - began_s
        autopilot.blow(north * rate_m_s2 * away_s, east * rate_m_s2 * away_s)
        if app.flight.phase is Phase.HOLD:
            noticed_s.append(away_s)
            autopilot.crash("the rest of the flight is not needed")

    settings = configuration.load(None, {"sensors.profile": "paper"})
    setup = Setup(load_world("room_100"), "room_100", 1, settings.sensors, autopilot)
    fly_in_lockstep(setup, settings, lambda progress: None, script=fly_away)
    assert noticed_s
    assert noticed_s[0] < (0.6 if rate_m_s2 > 2 else 1.3) + TICK_S


def velocity_ne_m_s(simulation: Simulation) -> Vector2:
    return simulation.autopilot.truth.velocity_ned_m_s[:2]
