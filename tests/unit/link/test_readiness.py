"""Tests of what the link waits for before a flight: estimate, parameters, one sender of poses."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.link.transports.transport import Message, sent_by
from tests.unit.link.scripted_vehicle import (
    Vehicle,
    attitude,
    heartbeat,
    landed_state,
    position,
    px4_heartbeat,
    px4_parameter,
    ticks_for,
)


def test_estimate_is_ready_with_flags_position_timeout_and_landed_state(vehicle: Vehicle) -> None:
    def report(flags: int) -> Message:
        return mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0)

    timeout = mavlink.MAVLink_param_value_message(b"GUID_TIMEOUT", 0.5, 9, 1, 65535)
    assert not vehicle.sends(heartbeat(), report(167)).vehicle.estimate_ready
    assert not vehicle.sends(report(895)).vehicle.estimate_ready
    assert not vehicle.sends(position(1), timeout, landed_state(0)).vehicle.estimate_ready
    assert vehicle.link.poll(0.0).vehicle.waits_for == "it does not send ATTITUDE"
    state = vehicle.sends(attitude(1)).vehicle
    assert not state.estimate_ready
    assert "whether it has landed (EXTENDED_SYS_STATE)" in state.waits_for
    assert vehicle.sends(landed_state(1)).vehicle.estimate_ready
    assert not vehicle.sends(report(167)).vehicle.estimate_ready


PX4_ESTIMATE_AT_REST = 495


def px4_estimate(flags: int) -> Message:
    return mavlink.MAVLink_estimator_status_message(0, flags, *(0.0,) * 8)


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (PX4_ESTIMATE_AT_REST, ""),
        (511, ""),
        (367, ""),
        (239, ""),
        (229, "no velocity source"),
        (128, "not settled"),
        (PX4_ESTIMATE_AT_REST & ~8, "no position"),
    ],
)
def test_px4_estimate_is_ready_at_rest_but_not_without_position_or_velocity(
    flags: int, complaint: str
) -> None:
    vehicle = Vehicle()
    timeout = mavlink.MAVLink_param_value_message(b"COM_OF_LOSS_T", 0.5, 9, 1, 0)
    action = px4_parameter(b"COM_OBL_RC_ACT", 4)
    vehicle.sends(px4_heartbeat(), position(1), attitude(1), landed_state(1))
    state = vehicle.sends(timeout, action, px4_estimate(flags)).vehicle
    assert state.estimate_ready == (not complaint)
    assert complaint in state.waits_for


# Our pose


ARDUPILOT_POSE = {"VISO_TYPE": 1, "EK3_SRC1_POSXY": 6, "EK3_SRC1_VELXY": 5, "EK3_SRC1_YAW": 6}
PX4_POSE = {"EKF2_EV_CTRL": 9, "EKF2_OF_CTRL": 1}


class PoseVehicle(Vehicle):
    """A vehicle that is ready except for its parameters on our pose."""

    def __init__(self, autopilot: str, parameters: dict[str, int]) -> None:
        super().__init__(LinkConfig(send_pose=True))
        if autopilot == "px4":
            timeout = mavlink.MAVLink_param_value_message(b"COM_OF_LOSS_T", 0.5, 9, 1, 0)
            self.sends(px4_heartbeat(), timeout, px4_parameter(b"COM_OBL_RC_ACT", 4))
            self.sends(px4_estimate(PX4_ESTIMATE_AT_REST))
            reports = [px4_parameter(name.encode(), value) for name, value in parameters.items()]
        else:
            timeout = mavlink.MAVLink_param_value_message(b"GUID_TIMEOUT", 0.5, 9, 1, 0)
            report = mavlink.MAVLink_ekf_status_report_message(895, 0, 0, 0, 0, 0)
            self.sends(heartbeat(), timeout, report)
            reports = [
                mavlink.MAVLink_param_value_message(name.encode(), value, 2, 1, 0)
                for name, value in parameters.items()
            ]
        self.sends(position(1), attitude(1), landed_state(1), *reports)

    @property
    def waits_for(self) -> str:
        return self.sends().vehicle.waits_for


@pytest.mark.parametrize(
    ("autopilot", "right", "name", "wrong"),
    [
        ("ardupilot", ARDUPILOT_POSE, "EK3_SRC1_YAW", 1),
        ("ardupilot", ARDUPILOT_POSE, "EK3_SRC1_VELXY", 6),
        ("ardupilot", ARDUPILOT_POSE, "EK3_SRC1_POSXY", 0),
        ("ardupilot", ARDUPILOT_POSE, "VISO_TYPE", 0),
        ("px4", PX4_POSE, "EKF2_EV_CTRL", 5),
        ("px4", PX4_POSE, "EKF2_EV_CTRL", 0),
        ("px4", PX4_POSE, "EKF2_OF_CTRL", 0),
    ],
)
def test_an_autopilot_with_wrong_parameters_for_our_pose_is_refused(
    autopilot: str, right: dict[str, int], name: str, wrong: int
) -> None:
    assert PoseVehicle(autopilot, right).waits_for == ""
    waits_for = PoseVehicle(autopilot, {**right, name: wrong}).waits_for
    assert f"{name} is {wrong}, set it to {right[name]}" in waits_for
    without = {other: value for other, value in right.items() if other != name}
    assert f"does not report {name}" in PoseVehicle(autopilot, without).waits_for


def test_pose_parameters_are_not_requested_without_send_pose() -> None:
    vehicle = Vehicle()
    vehicle.sends(heartbeat())
    assert not any(m.get_type() == "PARAM_REQUEST_READ" for m in ticks_for(vehicle, 3))


@pytest.mark.parametrize("component", [197, 25])
@pytest.mark.parametrize("kind", ["odometry", "vision"])
def test_a_second_sender_of_poses_is_refused(component: int, kind: str) -> None:
    vehicle = PoseVehicle("ardupilot", ARDUPILOT_POSE)
    message = (
        mavlink.MAVLink_vision_position_estimate_message(0, 0, 0, 0, 0, 0, 0)
        if kind == "vision"
        else mavlink.MAVLink_odometry_message(
            *(0, 20, 12, 0, 0, 0, [1, 0, 0, 0], *(0,) * 6, [0] * 21, [0] * 21, 0, 2)
        )
    )
    vehicle.sends(sent_by(message, component, 0))
    assert f"component {component} sends it a pose" in vehicle.waits_for
    vehicle.now_s += 6
    vehicle.sends(heartbeat())
    assert vehicle.waits_for == ""


def test_the_autopilots_own_odometry_does_not_count_as_a_second_sender() -> None:
    vehicle = PoseVehicle("px4", PX4_POSE)
    own = mavlink.MAVLink_odometry_message(
        *(0, 1, 12, 0, 0, 0, [1, 0, 0, 0], *(0,) * 6, [0] * 21, [0] * 21, 0, 8)
    )
    vehicle.sends(own)
    assert vehicle.waits_for == ""


# The pilot


RECEIVER = mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER


def sys_status(present: int, healthy: int) -> Message:
    return mavlink.MAVLink_sys_status_message(
        present, present, healthy, 0, 12000, 100, 90, 0, 0, 0, 0, 0, 0
    )


def ready_but_for_the_pilot(mode: int) -> Vehicle:
    vehicle = Vehicle(needs_pilot=True)
    timeout = mavlink.MAVLink_param_value_message(b"GUID_TIMEOUT", 0.5, 9, 1, 65535)
    estimate = mavlink.MAVLink_ekf_status_report_message(895, 0, 0, 0, 0, 0)
    vehicle.sends(heartbeat(mode), position(1), attitude(1), timeout, landed_state(1), estimate)
    return vehicle


@pytest.mark.parametrize(
    ("present", "healthy", "is_received"),
    [(0, 0, False), (0, RECEIVER, False), (RECEIVER, 0, False), (RECEIVER, RECEIVER, True)],
)
def test_a_pilot_needs_a_transmitter_that_is_received_now(
    present: int, healthy: int, is_received: bool
) -> None:
    """PX4 reports a missing receiver as healthy, ArduPilot a lost transmitter as present."""
    state = ready_but_for_the_pilot(mode=5).sends(sys_status(present, healthy)).vehicle
    assert state.estimate_ready == is_received
    assert is_received or "preflight.transmitter = true needs" in state.waits_for


@pytest.mark.parametrize(
    ("mode", "words"),
    [(5, ""), (2, ""), (16, ""), (0, "STABILIZE"), (9, "LAND"), (4, "GUIDED")],
)
def test_a_take_off_begins_from_a_mode_that_holds_the_height(mode: int, words: str) -> None:
    vehicle = ready_but_for_the_pilot(mode)
    state = vehicle.sends(sys_status(RECEIVER, RECEIVER)).vehicle
    assert state.estimate_ready == (not words)
    assert words in state.waits_for
    assert not words or "switch to LOITER, POSHOLD, ALT_HOLD" in state.waits_for
