"""Builds the messages for an autopilot without own sensors: drifting odometry, and ranges.

The odometry is that of an optical flow sensor: body-frame velocity with scale error and noise,
rotated by the autopilot's own heading and integrated.
"""

import math
from random import Random

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import Vector3
from companion.core.messages import Beam
from sitl.autopilot.estimation.estimator import AutopilotEstimator
from sitl.autopilot.estimation.external_messages import rotated
from sitl.autopilot.estimation.ground_truth import quaternion_wxyz
from sitl.autopilot.streams import Message
from sitl.core.truth import TrueState
from sitl.sensors.beam import RangeQuery
from sitl.sensors.board import BEAM_FRD, to_ned

INFRARED = mavlink.MAV_DISTANCE_SENSOR_INFRARED
MIN_CM, MAX_CM = 2, 550
"""Range limits in DISTANCE_SENSOR, cm. Chosen."""
RANGE_SIGMA_M = 0.02
"""Standard deviation of the ranges, m. Chosen."""
GEAR_M = 0.1
"""Height of the sensors over the ground when the vehicle stands, m. Chosen."""
POSE_SIGMAS = (0.05, 0.05, 0.05, 0.02, 0.02, 0.05)
"""Standard deviations of x, y, z, m, and roll, pitch, yaw, rad, between messages; without drift."""
VELOCITY_SIGMAS = (0.05, 0.05, 0.05, 0.05, 0.05, 0.05)
"""Standard deviations, m/s and rad/s: step noise of `OdometryNoise`, and its scale at walking
speed."""
UNKNOWN = math.nan
POSE_FRAME = {
    "ardupilot": mavlink.MAV_FRAME_LOCAL_FRD,
    "px4": mavlink.MAV_FRAME_LOCAL_NED,
}
"""ArduPilot accepts no other frame. PX4 would rotate LOCAL_FRD by the difference of two headings,
but here the heading is PX4's own."""
ORIENTATION = {
    Beam.FRONT: mavlink.MAV_SENSOR_ROTATION_NONE,
    Beam.RIGHT: mavlink.MAV_SENSOR_ROTATION_YAW_90,
    Beam.LEFT: mavlink.MAV_SENSOR_ROTATION_YAW_270,
    Beam.UP: mavlink.MAV_SENSOR_ROTATION_PITCH_90,
    Beam.DOWN: mavlink.MAV_SENSOR_ROTATION_PITCH_270,
}
"""MAV_SENSOR_ORIENTATION by beam."""


def odometry(firmware: str, estimator: AutopilotEstimator, truth: TrueState) -> Message:
    """ODOMETRY (331): the pose, and the velocity in the body frame."""
    w, x, y, z = quaternion_wxyz(truth.roll_rad, truth.pitch_rad, estimator.yaw_rad)
    return mavlink.MAVLink_odometry_message(
        round(truth.time_s * 1e6),
        POSE_FRAME[firmware],
        mavlink.MAV_FRAME_BODY_FRD,
        *estimator.position_ned_m,
        [w, x, y, z],
        *rotated((w, -x, -y, -z), estimator.velocity_ned_m_s),
        *(UNKNOWN,) * 3,
        _covariance(POSE_SIGMAS),
        _covariance(VELOCITY_SIGMAS),
        0,
        mavlink.MAV_ESTIMATOR_TYPE_VIO,
        0,
    )


def _covariance(sigmas: tuple[float, ...]) -> list[float]:
    """(21,): the upper triangle of a diagonal matrix, row-major."""
    size = len(sigmas)
    return [
        sigmas[row] ** 2 if row == column else 0.0
        for row in range(size)
        for column in range(row, size)
    ]


def distances(truth: TrueState, range_m: RangeQuery, random: Random) -> list[Message]:
    """DISTANCE_SENSOR (132) for each beam; without a return, 1 cm beyond the maximum."""
    return [
        _distance(truth, ORIENTATION[beam], number, _measured(truth, beam, range_m, random))
        for number, beam in enumerate(ORIENTATION)
    ]


def _measured(truth: TrueState, beam: Beam, range_m: RangeQuery, random: Random) -> float | None:
    north, east, down = truth.position_ned_m
    eye: Vector3 = (north, east, down - GEAR_M)
    distance_m = range_m(eye, to_ned(BEAM_FRD[beam], truth), MAX_CM / 100)
    return None if distance_m is None else distance_m + random.gauss(0, RANGE_SIGMA_M)


def _distance(truth: TrueState, orientation: int, number: int, distance_m: float | None) -> Message:
    current_cm = MAX_CM + 1 if distance_m is None else round(100 * distance_m)
    return mavlink.MAVLink_distance_sensor_message(
        round(truth.time_s * 1e3) % 2**32,
        MIN_CM,
        MAX_CM,
        max(MIN_CM, min(MAX_CM + 1, current_cm)),
        INFRARED,
        number,
        orientation,
        round((100 * RANGE_SIGMA_M) ** 2),
    )
