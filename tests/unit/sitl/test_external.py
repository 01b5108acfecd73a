"""Tests of external autopilots: messages received and sent, without sockets."""

import math
import statistics
import struct
from dataclasses import replace
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import Vector3
from companion.link.transports.transport import Message, pipe_pair
from sitl.autopilot.core import FIRMWARES
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE, AutopilotEstimator
from sitl.autopilot.estimation.external_messages import ExternalMessages
from sitl.autopilot.estimation.ground_truth import hil_state_quaternion, sim_state
from sitl.autopilot.parameters.table import load_table
from sitl.core.truth import TrueState
from sitl.external.clock import AutopilotClock, Silence
from sitl.external.feed import GEAR_M, distances, odometry
from sitl.external.held_speed import TICKS, HeldSpeed
from sitl.external.setup import ExternalSetup, wanted_parameters
from sitl.external.tracker import TruthTracker
from tests.unit.sitl.autopilot.client import START, as_float

AUTOPILOT_OF = {"ardupilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, "px4": mavlink.MAV_AUTOPILOT_PX4}
ENCODERS = {"ardupilot": sim_state, "px4": hil_state_quaternion}
WORLD_START = replace(START, position_ned_m=(4.0, 6.5, 0.0))
PERIOD_S = 0.02


def on_the_wire(*messages: Message) -> list[Any]:
    """The messages as the autopilot component of system 1 sends them."""
    autopilot, ours = pipe_pair()
    for message in messages:
        autopilot.send(message)
    return ours.receive()


def receives(tracker: TruthTracker, message: Message, now_s: float) -> bool:
    (received,) = on_the_wire(message)
    return tracker.receive(received, now_s)


# The clock


def attitude(boot_s: float) -> Message:
    return mavlink.MAVLink_attitude_message(round(1000 * boot_s), 0, 0, 0, 0, 0, 0)


def test_the_clock_follows_the_autopilots_time_despite_late_messages() -> None:
    clock = AutopilotClock()
    assert clock.receive(attitude(100.0), 3.0) == pytest.approx(3.0)
    assert clock.receive(attitude(100.02), 3.0) == pytest.approx(3.02)
    assert clock.receive(attitude(100.5), 3.9) == pytest.approx(3.5)
    assert clock.autopilot_s(3.9) == pytest.approx(3.5)


def test_the_clock_does_not_go_back_when_the_autopilot_restarts() -> None:
    clock = AutopilotClock()
    clock.receive(attitude(100.0), 50.0)
    assert clock.receive(attitude(0.3), 50.5) == pytest.approx(50.5)
    assert clock.receive(attitude(0.32), 50.5) == pytest.approx(50.52)


def test_a_heartbeat_does_not_set_the_clock() -> None:
    assert (
        AutopilotClock().receive(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3), 9.0) is None
    )


def test_silence_and_return_of_the_autopilot_are_reported_once_each() -> None:
    texts: list[str] = []
    silence = Silence(texts.append, began_s=0.0)
    for now_s in (0.5, 1.5, 2.0):
        silence.check(now_s)
    silence.receive(3.0)
    for now_s in (3.5, 4.5, 5.0):
        silence.check(now_s)
    silence.receive(6.0)
    assert texts == [
        "the autopilot has not sent a message yet: the simulation is paused until it sends",
        "the autopilot is connected",
        "the autopilot is silent: the simulation is paused until it sends",
        "the autopilot is connected again",
    ]


def speed_reports(speed: float, working_s: float, ticks: int = TICKS) -> list[str]:
    """Reports on the speed, for a companion with this working time per tick."""
    texts: list[str] = []
    held = HeldSpeed(texts.append)
    wall_s = time_s = 0.0
    tick = 0
    for _ in range(ticks):
        wall_s += working_s
        time_s = max(time_s, speed * wall_s)  # the autopilot continues meanwhile
        tick += 1
        held.asked(wall_s, working_s, time_s, tick * 0.05)
        time_s = max(time_s, tick * 0.05)
        wall_s = max(wall_s, time_s / speed)
        tick = max(tick, int(time_s / 0.05))
        held.reached(wall_s, 0.0, time_s)
    return texts


def test_the_sustainable_speed_is_reported() -> None:
    (line,) = speed_reports(speed=1.0, working_s=0.01)
    assert "runs at 1.0 x" in line
    assert "holds 5.0 x" in line
    assert "late" not in line


def test_a_companion_that_cannot_keep_up_is_reported() -> None:
    lines = speed_reports(speed=5.0, working_s=0.02, ticks=3 * TICKS)
    assert len(lines) == 3
    assert all("holds 2.5 x" in line and "late" in line for line in lines)


# The truth


def flown(time_s: float) -> TrueState:
    """State on a circle of 2 m radius at 1 m/s and a height of 1.2 m, nose along the path."""
    angle = 0.5 * time_s
    return TrueState(
        time_s,
        (2 * math.sin(angle), 2 * (1 - math.cos(angle)), -1.2),
        (math.cos(angle), math.sin(angle), 0.0),
        0.05,
        -0.1,
        angle,
        0.5,
    )


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_the_mean_tracking_error_is_below_the_message_resolution(firmware: str) -> None:
    tracker = TruthTracker(WORLD_START)
    encode = ENCODERS[firmware]
    receives(tracker, encode(START), now_s=0.0)
    errors_m = []
    for step in range(1, 300):
        truth = flown(step * PERIOD_S)
        assert receives(tracker, encode(truth), now_s=truth.time_s)
        between = tracker.at(truth.time_s + PERIOD_S / 2).position_ned_m
        expected = flown(truth.time_s + PERIOD_S / 2).position_ned_m
        off = [
            b - e - s for b, e, s in zip(between, expected, WORLD_START.position_ned_m, strict=True)
        ]
        errors_m.append(math.hypot(*off[:2]))
    assert statistics.fmean(errors_m[50:]) < 0.006
    assert max(errors_m[50:]) < 0.015


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_attitude_and_yaw_rate_are_used_as_reported(firmware: str) -> None:
    tracker = TruthTracker(WORLD_START)
    receives(tracker, ENCODERS[firmware](flown(3.0)), now_s=9.0)
    reported, state = flown(3.0), tracker.at(9.1)
    assert (state.roll_rad, state.pitch_rad) == pytest.approx(
        (reported.roll_rad, reported.pitch_rad), abs=1e-5
    )
    assert state.yaw_rad == pytest.approx(
        reported.yaw_rad + 0.1 * reported.yaw_rate_rad_s, abs=1e-5
    )
    assert tracker.home is not None


def test_a_position_jump_of_the_simulation_is_followed_at_once() -> None:
    tracker = TruthTracker(WORLD_START)
    receives(tracker, sim_state(START), now_s=0.0)
    moved = replace(START, position_ned_m=(30.0, -5.0, -1.0))
    receives(tracker, sim_state(moved), now_s=0.1)
    assert tracker.state.position_ned_m == pytest.approx((34.0, 1.5, -1.0), abs=0.02)


def test_the_tracker_ignores_messages_without_ground_truth() -> None:
    tracker = TruthTracker(WORLD_START)
    assert not receives(tracker, attitude(1.0), now_s=1.0)
    assert tracker.home is None


# Configuration of the autopilot


class Setup:
    """An autopilot during its set-up; the test chooses its answers to the requests."""

    def __init__(self, firmware: str) -> None:
        self.firmware = firmware
        self.texts: list[str] = []
        self.now_s = 0.0
        self.setup = ExternalSetup(self.texts.append)
        self.sends(
            mavlink.MAVLink_heartbeat_message(2, AUTOPILOT_OF[firmware], 0, 0, 3, 3),
            mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 3, 3),
        )

    def sends(self, *messages: Message) -> None:
        for message in on_the_wire(*messages):
            self.setup.receive(message, self.now_s)

    def sends_parameter(self, name: str, value: float) -> None:
        kind = load_table(self.firmware)[name].kind
        bytewise = self.firmware == "px4" and kind == mavlink.MAV_PARAM_TYPE_INT32
        wire = as_float("<i", int(value)) if bytewise else value
        self.sends(mavlink.MAVLink_param_value_message(name.encode(), wire, kind, 1, 0))

    def asks(self) -> list[Any]:
        self.now_s += 1.01
        return self.setup.requests(self.now_s, (470000000, 80000000, 400000))


def of_kind(messages: list[Any], kind: str) -> list[Any]:
    return [message for message in messages if message.get_type() == kind]


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_parameters_are_read_first_and_set_only_if_different(firmware: str) -> None:
    external, wanted = Setup(firmware), wanted_parameters(firmware)
    first = external.asks()
    assert {m.param_id for m in of_kind(on_the_wire(*first), "PARAM_REQUEST_READ")} == set(wanted)
    assert not of_kind(first, "PARAM_SET")
    wrong, *right = wanted
    for name in right:
        external.sends_parameter(name, wanted[name])
    external.sends_parameter(wrong, wanted[wrong] + 3)
    (change,) = of_kind(on_the_wire(*external.asks()), "PARAM_SET")
    assert change.param_id == wrong
    external.sends_parameter(wrong, wanted[wrong])
    external.asks()
    assert any(line == f"parameters set: {wrong}" for line in external.texts)
    assert not of_kind(external.asks(), "PARAM_SET")


def test_integers_are_sent_to_px4_bytewise() -> None:
    external = Setup("px4")
    external.sends_parameter("EKF2_EV_CTRL", 0)
    (change,) = of_kind(on_the_wire(*external.asks()), "PARAM_SET")
    assert change.param_type == mavlink.MAV_PARAM_TYPE_INT32
    assert struct.pack("<f", change.param_value) == struct.pack("<i", 5)


def test_only_boot_time_parameters_require_a_restart() -> None:
    external, wanted = Setup("ardupilot"), wanted_parameters("ardupilot")
    for name, value in wanted.items():
        if name in ("VISO_TYPE", "EK3_SRC1_POSXY"):
            external.sends_parameter(name, 0)
        external.sends_parameter(name, value)
    external.asks()
    (line,) = [line for line in external.texts if "restart" in line]
    assert "VISO_TYPE" in line
    assert "EK3_SRC1_POSXY" not in line


def test_streams_are_requested_until_received_and_the_origin_is_never_set() -> None:
    external = Setup("px4")
    for _ in range(2):
        asked = external.asks()
        assert {m.param1 for m in of_kind(asked, "COMMAND_LONG") if m.command == 511} == {115, 30}
        assert not of_kind(asked, "SET_GPS_GLOBAL_ORIGIN")
    external.now_s += 1.0
    origin = mavlink.MAVLink_gps_global_origin_message(470000000, 80000000, 400000)
    external.sends(hil_state_quaternion(START), attitude(1.0), origin)
    external.now_s -= 1.0
    asked = external.asks()
    assert not of_kind(asked, "COMMAND_LONG")


@pytest.mark.parametrize(("lat", "is_reported"), [(470000000, False), (-353632621, True)])
def test_an_origin_far_from_the_simulated_place_is_reported(lat: int, is_reported: bool) -> None:
    external = Setup("ardupilot")
    external.asks()
    external.sends(mavlink.MAVLink_gps_global_origin_message(lat, 80000000, 400000))
    reported = [line for line in external.texts if "origin_lat_deg = 47.0000" in line]
    assert bool(reported) == is_reported


def test_no_request_is_sent_before_the_first_heartbeat() -> None:
    assert ExternalSetup(lambda text: None).requests(5.0, None) == []


# Messages to the autopilot


def test_ranges_are_sent_as_a_real_sensor_reports_them() -> None:
    truth = replace(flown(0.0), roll_rad=0.0, pitch_rad=0.0)

    def room(origin: Vector3, direction: Vector3, most_m: float) -> float | None:
        """A floor below, a wall 3 m ahead, and nothing else in range."""
        if direction[2] > 0.9:
            return -origin[2]
        return 3.0 if direction[0] > 0.9 else None

    random = Random(1)
    reported = [distances(truth, room, random) for _ in range(50)]
    by_orientation = {m.orientation: m for m in reported[0]}
    assert set(by_orientation) == {0, 2, 6, 24, 25}
    down_cm = [m.current_distance for sweep in reported for m in sweep if m.orientation == 25]
    assert statistics.fmean(down_cm) == pytest.approx(100 * (1.2 + GEAR_M), abs=1.5)
    assert 1 < statistics.stdev(down_cm) < 4
    down, right = by_orientation[25], by_orientation[2]
    assert down.min_distance < down.current_distance < down.max_distance
    assert right.current_distance > right.max_distance


def test_the_down_range_on_the_ground_is_the_height_of_the_landing_gear() -> None:
    reported = distances(START, lambda origin, direction, most_m: -origin[2] or None, Random(1))
    (down,) = [m for m in reported if m.orientation == 25]
    assert down.min_distance < down.current_distance < 20


def test_the_odometry_has_noise_and_drift() -> None:
    start = flown(0.0)
    estimator = AutopilotEstimator(start, 3, REFERENCE_NOISE)
    errors_m = []
    for step in range(1, 6000):
        truth = flown(step * 0.01)
        estimator.update(truth)
        estimator.yaw_rad = truth.yaw_rad
        if step % 100 == 0:
            (reported,) = on_the_wire(odometry("px4", estimator, truth))
            at = [t - s for t, s in zip(truth.position_ned_m, start.position_ned_m, strict=True)]
            errors_m.append(math.dist((reported.x, reported.y), at[:2]))
            assert math.hypot(reported.vx, reported.vy) == pytest.approx(1.0, abs=0.15)
            assert reported.time_usec == round(truth.time_s * 1e6)
    assert all(error_m > 1e-4 for error_m in errors_m)
    assert max(errors_m) < 2.0
    assert statistics.fmean(errors_m[-10:]) > 0.02


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_the_odometry_velocity_is_correct_at_any_attitude(firmware: str) -> None:
    tilted = replace(START, roll_rad=0.2, pitch_rad=-0.1)
    estimator = AutopilotEstimator(tilted, 1, REFERENCE_NOISE)
    estimator.yaw_rad = 2.0
    estimator.position_ned_m, estimator.velocity_ned_m_s = (2.0, -1.0, -1.5), (0.5, 0.25, -0.1)
    (reported,) = on_the_wire(odometry(firmware, estimator, tilted))
    outside = ExternalMessages(FIRMWARES[firmware]().pose_messages)
    assert outside.receive(reported, 0.0) == ""
    pose = outside.take_pose()
    assert pose is not None
    assert pose.velocity_ned_m_s == pytest.approx((0.5, 0.25, -0.1), abs=1e-5)
    assert pose.position_ned_m == pytest.approx((2.0, -1.0, -1.5))
    assert pose.yaw_rad == pytest.approx(2.0)
