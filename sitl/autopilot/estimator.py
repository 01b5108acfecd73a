"""The autopilot's own position estimate: optical flow and a compass, without GPS. It drifts."""

import math
from dataclasses import dataclass
from random import Random

from companion.frames import Vector3, frd_to_ned, ned_to_frd, wrap_rad
from sitl.truth import TrueState

CONVERGES_S = 4.0
"""After boot, until the attitude has settled."""
WALK_STEPS = 10
WALK_S = 0.1
HEIGHT_DRIFT_TIME_CONSTANT_S = 30.0


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """The reference noise; sigmas."""

    scale: float = 0.03
    step_m: float = 0.005
    """On each axis, a step at 10 Hz."""
    gyro_bias_rad_s: float = math.radians(0.1)
    gyro_scale: float = 0.02
    compass_rad: float = math.radians(5.0)
    height_m: float = 0.01
    height_drift_m: float = 0.03


REFERENCE_NOISE = OdometryNoise()


class FlowEstimator:
    """Position, velocity and yaw as the autopilot believes them; its own NED from where it began.

    The control loops close on this estimate, so its errors become true motion.
    """

    def __init__(self, start: TrueState, random: Random, noise: OdometryNoise) -> None:
        self._random = random
        self._noise = noise
        self._scale = 1 + random.gauss(0, noise.scale)
        self._gyro_bias = random.gauss(0, noise.gyro_bias_rad_s)
        self._gyro_scale = 1 + random.gauss(0, noise.gyro_scale)
        self._truth = start
        self._floor = start.position_ned_m[2]
        self._steps = 0
        self._drift_m = self._height_error_m = 0.0
        self.yaw_rad = wrap_rad(start.yaw_rad + random.gauss(0, noise.compass_rad))
        self.yaw_rate_rad_s = 0.0
        self.position_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self.velocity_ned_m_s: Vector3 = (0.0, 0.0, 0.0)

    @property
    def has_settled(self) -> bool:
        return self._truth.time_s >= CONVERGES_S

    @property
    def scale(self) -> float:
        return self._scale

    def update(self, truth: TrueState) -> None:
        """Take in one step of true motion."""
        dt_s = truth.time_s - self._truth.time_s
        moving = truth.position_ned_m[2] < self._floor
        if moving:
            self.yaw_rate_rad_s = truth.yaw_rate_rad_s * self._gyro_scale + self._gyro_bias
            self.yaw_rad = wrap_rad(self.yaw_rad + self.yaw_rate_rad_s * dt_s)
        north, east, _ = truth.velocity_ned_m_s
        forward, right = ned_to_frd(north, east, truth.yaw_rad)
        north, east = frd_to_ned(forward * self._scale, right * self._scale, self.yaw_rad)
        self._steps += 1
        if self._steps % WALK_STEPS == 0:
            self._wander(moving=moving)
        x, y, _ = self.position_ned_m
        down = truth.position_ned_m[2] - self._floor + self._height_error_m
        self.position_ned_m = (x + north * dt_s, y + east * dt_s, down)
        self.velocity_ned_m_s = (north, east, truth.velocity_ned_m_s[2])
        self._truth = truth

    def _wander(self, *, moving: bool) -> None:
        """What goes wrong ten times a second."""
        gauss, noise = self._random.gauss, self._noise
        if moving:
            x, y, down = self.position_ned_m
            self.position_ned_m = (x + gauss(0, noise.step_m), y + gauss(0, noise.step_m), down)
        fade = WALK_S / HEIGHT_DRIFT_TIME_CONSTANT_S
        kick = noise.height_drift_m * math.sqrt(2 * fade)
        self._drift_m += -fade * self._drift_m + gauss(0, kick)
        self._height_error_m = self._drift_m + gauss(0, noise.height_m)

    def to_true_frame(self, velocity_ned_m_s: Vector3) -> Vector3:
        """The true velocity that the estimate would call this: what its control loop ends at."""
        north, east, down = velocity_ned_m_s
        forward, right = ned_to_frd(north, east, self.yaw_rad)
        north, east = frd_to_ned(forward / self._scale, right / self._scale, self._truth.yaw_rad)
        return north, east, down

    def to_true_rate(self, yaw_rate_rad_s: float) -> float:
        return (yaw_rate_rad_s - self._gyro_bias) / self._gyro_scale
