"""The autopilot's own estimate of pose and velocity without GPS, with drift.

true motion ─► optical flow (scale, noise, dropouts) ─► velocity ─► position
true motion ─► inertial sensors, with drift ──────────────┘  ▲        ▲
external pose (ODOMETRY, VISION_...), if selected ───────────┴────────┘
"""

import math
from dataclasses import dataclass, replace

from companion.core.frames import Vector3, frd_to_ned, ned_to_frd, wrap_rad
from sitl.autopilot.estimation.external_messages import ExternalPose
from sitl.autopilot.estimation.velocity_error import NO_ERROR, EstimateErrors, VelocityError
from sitl.autopilot.firmware import Sources
from sitl.core.noise import stream
from sitl.core.truth import TrueState

CONVERGES_S = 4.0
"""Time from boot until the attitude has settled, s. Chosen."""
WALK_STEPS = 10
"""Steps between two draws of the errors."""
WALK_S = 0.1
"""Time between two draws of the errors, s."""
HEIGHT_DRIFT_TIME_CONSTANT_S = 30.0
"""Correlation time of the height drift, s. Chosen."""
MIN_FLOW_HEIGHT_M = 0.2
"""Lower bound of the height in the flow error, m. Chosen."""
POSITION_GAIN, VELOCITY_GAIN, YAW_GAIN = 0.15, 0.1, 0.1
VELOCITY_FROM_POSITION_1_S = 0.5
"""Gains of one external pose. At 50 Hz the estimate follows within about 0.2 s."""
FLOW_ONLY = Sources(flow=True)
ERROR_S, SWING_RAD_S = 1.0, 1.5
VERTICAL_ERROR_S, VERTICAL_ERROR_RAD_S = 0.5, 2.5
"""Correlation time, s, and angular frequency, rad/s, of the velocity error.

Measured on PX4 1.17 in hover, horizontal and vertical.
"""
HEADING_MOVES_S = 3.0
"""Time from lift-off until the heading has settled again, s. Measured on PX4 1.17."""


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Reference noise, with further errors of flow sensors; standard deviations."""

    scale: float = 0.03
    step_m: float = 0.005
    """Per axis, for each step at 10 Hz."""
    gyro_bias_rad_s: float = math.radians(0.1)
    gyro_scale: float = 0.02
    gyro_white_rad_s_sqrt_hz: float = math.radians(0.005)
    """Noise of an ICM-42688 or similar, with vibration."""
    gyro_walk_rad_s_sqrt_s: float = math.radians(0.001)
    """Random walk of the gyro bias, unobservable for the autopilot without a compass."""
    compass_rad: float = math.radians(5.0)
    height_m: float = 0.01
    height_drift_m: float = 0.03
    flow_height_m: float = 0.005
    """Error of the height that scales the flow, redrawn at 10 Hz; larger effect when low."""
    flow_dropout: float = 0.002
    """Probability, at 10 Hz, of a floor without texture: the last velocity holds for 0.1 s."""
    inertial_m_s2: float = 0.02
    """Velocity drift without correction."""
    estimate: float = 1.0
    """Factor on the errors of the firmware's estimator (`velocity_error.py`)."""

    def times(self, factor: float) -> "OdometryNoise":
        """Noise with all drift multiplied by a factor; the rate of flow dropouts stays."""
        return replace(
            self,
            scale=factor * self.scale,
            step_m=factor * self.step_m,
            gyro_bias_rad_s=factor * self.gyro_bias_rad_s,
            gyro_scale=factor * self.gyro_scale,
            gyro_white_rad_s_sqrt_hz=factor * self.gyro_white_rad_s_sqrt_hz,
            gyro_walk_rad_s_sqrt_s=factor * self.gyro_walk_rad_s_sqrt_s,
            flow_height_m=factor * self.flow_height_m,
            estimate=factor * self.estimate,
        )


REFERENCE_NOISE = OdometryNoise()
"""Noise of all benchmarks, unless they vary it."""


class AutopilotEstimator:
    """The autopilot's estimate of position, velocity and yaw, in its NED frame from its start.

    The control loops close on this estimate, so its errors become true motion.
    """

    def __init__(
        self,
        start: TrueState,
        seed: int,
        noise: OdometryNoise,
        error: EstimateErrors = NO_ERROR,
    ) -> None:
        self._random = random = stream(seed, "flow")
        self._flow_random = stream(seed, "flow dropouts")
        self._inertial_random = stream(seed, "inertial drift")
        self._attitude_random = stream(seed, "attitude drift")
        self._noise = noise
        velocity_random = stream(seed, "velocity error")
        sway_random = stream(seed, "velocity tracking")
        self._velocity_ne = [
            VelocityError(
                velocity_random,
                noise.estimate * error.velocity_m_s,
                ERROR_S,
                SWING_RAD_S,
            )
            for _ in range(2)
        ]
        self._sway_ne = [
            VelocityError(sway_random, noise.estimate * error.sway_m_s, ERROR_S, SWING_RAD_S)
            for _ in range(2)
        ]
        self._velocity_down = VelocityError(
            velocity_random,
            noise.estimate * error.climb_m_s,
            VERTICAL_ERROR_S,
            VERTICAL_ERROR_RAD_S,
        )
        self._heading_moves_rad_s = (
            stream(seed, "heading at take-off").gauss(0, error.take_off_heading_rad)
            * noise.estimate
            / HEADING_MOVES_S
        )
        self._lifted_s: float | None = None
        self._scale = 1 + random.gauss(0, noise.scale)
        self._gyro_bias = random.gauss(0, noise.gyro_bias_rad_s)
        self._gyro_scale = 1 + random.gauss(0, noise.gyro_scale)
        self._truth = start
        self._settles_at_s = CONVERGES_S
        self._floor = start.position_ned_m[2]
        self._steps = 0
        self._drift_m = self._height_error_m = 0.0
        self._flow_scale = self._scale
        self._flow_held: tuple[float, float] | None = None
        self._sources = FLOW_ONLY
        self._inertial_error = (0.0, 0.0)
        self._reset_counter: int | None = None
        self.yaw_rad = wrap_rad(start.yaw_rad + random.gauss(0, noise.compass_rad))
        self.yaw_rate_rad_s = 0.0
        self.position_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self.velocity_ned_m_s: Vector3 = (0.0, 0.0, 0.0)

    @property
    def _velocity_errors(self) -> tuple[VelocityError, ...]:
        return (*self._velocity_ne, *self._sway_ne, self._velocity_down)

    @property
    def has_settled(self) -> bool:
        return self._truth.time_s >= self._settles_at_s

    def restart(self) -> None:
        """Restart at the vehicle's current position, as after power-on."""
        self._settles_at_s = self._truth.time_s + CONVERGES_S
        self.position_ned_m = self.velocity_ned_m_s = (0.0, 0.0, 0.0)

    def jump(self, north_m: float, east_m: float, down_m: float, yaw_rad: float) -> None:
        """A fault for tests: the estimate jumps."""
        x, y, _ = self.position_ned_m
        self.position_ned_m = (x + north_m, y + east_m, self.position_ned_m[2])
        self._drift_m += down_m
        self.yaw_rad = wrap_rad(self.yaw_rad + yaw_rad)

    def update(
        self, truth: TrueState, sources: Sources = FLOW_ONLY, pose: ExternalPose | None = None
    ) -> None:
        """Process one step of true motion and an external pose."""
        dt_s = truth.time_s - self._truth.time_s
        self._sources = sources
        moving = truth.position_ned_m[2] < self._floor
        if moving:
            self.yaw_rate_rad_s = truth.yaw_rate_rad_s * self._gyro_scale + self._gyro_bias
            self.yaw_rad = wrap_rad(self.yaw_rad + self.yaw_rate_rad_s * dt_s)
            self._move_heading(truth.time_s, dt_s)
            for error in self._velocity_errors:
                error.step(dt_s)
        self._steps += 1
        if self._steps % WALK_STEPS == 0:
            self._wander(truth, moving=moving)
        north, east = self._flow(truth) if sources.flow else self._inertial(truth)
        if moving:
            north += self._velocity_ne[0].velocity_m_s
            east += self._velocity_ne[1].velocity_m_s
        x, y, _ = self.position_ned_m
        down = truth.position_ned_m[2] - self._floor + self._height_error_m
        down += self._velocity_down.position_m
        self.position_ned_m = (x + north * dt_s, y + east * dt_s, down)
        sinking = truth.velocity_ned_m_s[2] + (self._velocity_down.velocity_m_s if moving else 0.0)
        if moving:
            north -= self._sway_ne[0].velocity_m_s
            east -= self._sway_ne[1].velocity_m_s
        self.velocity_ned_m_s = (north, east, sinking)
        if pose is not None:
            self._correct(pose)
        self._truth = truth

    def _flow(self, truth: TrueState) -> tuple[float, float]:
        if self._flow_held is not None:
            return self._flow_held
        north, east = self._as_turned(truth)
        return north * self._flow_scale, east * self._flow_scale

    def _inertial(self, truth: TrueState) -> tuple[float, float]:
        north, east = self._as_turned(truth)
        return north + self._inertial_error[0], east + self._inertial_error[1]

    def _as_turned(self, truth: TrueState) -> tuple[float, float]:
        """The true velocity in the estimated NED frame: rotated by the yaw error."""
        north, east, _ = truth.velocity_ned_m_s
        return frd_to_ned(north, east, self.yaw_rad - truth.yaw_rad)

    def _wander(self, truth: TrueState, *, moving: bool) -> None:
        """Draw the errors, ten times a second."""
        gauss, noise = self._random.gauss, self._noise
        if moving:
            x, y, down = self.position_ned_m
            self.position_ned_m = (x + gauss(0, noise.step_m), y + gauss(0, noise.step_m), down)
            self._drift_attitude()
            for error in self._velocity_errors:
                error.kick()
        fade = WALK_S / HEIGHT_DRIFT_TIME_CONSTANT_S
        kick = noise.height_drift_m * math.sqrt(2 * fade)
        self._drift_m += -fade * self._drift_m + gauss(0, kick)
        self._height_error_m = self._drift_m + gauss(0, noise.height_m)
        self._lose_flow(truth)
        self._drift_inertial(moving=moving)

    def _move_heading(self, now_s: float, dt_s: float) -> None:
        """The heading is realigned after lift-off, independent of the gyro."""
        self._lifted_s = now_s if self._lifted_s is None else self._lifted_s
        if now_s - self._lifted_s < HEADING_MOVES_S:
            self.yaw_rad = wrap_rad(self.yaw_rad + self._heading_moves_rad_s * dt_s)

    def _drift_attitude(self) -> None:
        gauss, noise, root_s = self._attitude_random.gauss, self._noise, math.sqrt(WALK_S)
        self.yaw_rad = wrap_rad(self.yaw_rad + gauss(0, noise.gyro_white_rad_s_sqrt_hz * root_s))
        self._gyro_bias += gauss(0, noise.gyro_walk_rad_s_sqrt_s * root_s)

    def _drift_inertial(self, *, moving: bool) -> None:
        drift = self._noise.inertial_m_s2 * WALK_S
        north, east = self._inertial_error
        gauss = self._inertial_random.gauss
        drifted = north + gauss(0, drift), east + gauss(0, drift)
        self._inertial_error = drifted if moving else (0.0, 0.0)

    def _lose_flow(self, truth: TrueState) -> None:
        random, noise = self._flow_random, self._noise
        height_m = max(self._floor - truth.position_ned_m[2], MIN_FLOW_HEIGHT_M)
        self._flow_scale = self._scale * (1 + random.gauss(0, noise.flow_height_m) / height_m)
        lost = random.random() < noise.flow_dropout
        self._flow_held = self.velocity_ned_m_s[:2] if lost else None

    def _correct(self, pose: ExternalPose) -> None:
        """Alpha-beta filter: correct position and velocity by an external pose."""
        sources = self._sources
        jumped = pose.reset_counter != self._reset_counter
        self._reset_counter = pose.reset_counter
        if sources.outside_yaw and pose.yaw_rad is not None:
            gain = 1.0 if jumped else YAW_GAIN
            self.yaw_rad = wrap_rad(self.yaw_rad + gain * wrap_rad(pose.yaw_rad - self.yaw_rad))
        if sources.outside_position and pose.position_ned_m is not None:
            gain = 1.0 if jumped else POSITION_GAIN
            x, y, down = self.position_ned_m
            off = pose.position_ned_m[0] - x, pose.position_ned_m[1] - y
            self.position_ned_m = (x + gain * off[0], y + gain * off[1], down)
            if not sources.outside_velocity and not jumped:
                self._pull_velocity(VELOCITY_FROM_POSITION_1_S, off)
        if sources.outside_velocity and pose.velocity_ned_m_s is not None:
            north, east, _ = self.velocity_ned_m_s
            off = pose.velocity_ned_m_s[0] - north, pose.velocity_ned_m_s[1] - east
            self._pull_velocity(VELOCITY_GAIN, off)

    def _pull_velocity(self, gain: float, off: tuple[float, float]) -> None:
        north, east = self._inertial_error
        self._inertial_error = north + gain * off[0], east + gain * off[1]

    def to_true_frame(self, velocity_ned_m_s: Vector3) -> Vector3:
        """True velocity that the control loop reaches for a velocity in the estimated frame."""
        north, east, down = velocity_ned_m_s
        north += self._sway_ne[0].velocity_m_s
        east += self._sway_ne[1].velocity_m_s
        down -= self._velocity_down.velocity_m_s
        scale = self._scale
        if not self._sources.flow:
            scale = 1.0
            north, east = north - self._inertial_error[0], east - self._inertial_error[1]
        north, east = ned_to_frd(north, east, self.yaw_rad - self._truth.yaw_rad)
        return north / scale, east / scale, down

    def to_true_rate(self, yaw_rate_rad_s: float) -> float:
        return (yaw_rate_rad_s - self._gyro_bias) / self._gyro_scale
