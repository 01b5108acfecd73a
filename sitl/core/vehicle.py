"""Models the quadrotor as a moving point with a heading, in steps of 10 ms.

Velocity follows the autopilot's shaped setpoint with a second-order lag. A share of each change
arrives late, through the velocity integrator. The parameters are fitted to measured steps of each
firmware (`docs/autopilot.md`). At rest on the ground the body's centre is at down = 0.
"""

import math
from dataclasses import dataclass
from random import Random

from companion.core.frames import Vector2, Vector3, ned_to_frd, wrap_rad
from sitl.core.truth import TrueState

STEP_S = 0.01
"""Time step, s."""
GUST_STEPS = 5
"""Steps between two draws of the gust."""
MAX_YAW_RATE_RAD_S = math.radians(90)
"""Yaw rate limit, rad/s. Chosen."""
GRAVITY_M_S2 = 9.81
"""Standard gravity, rounded, m/s²."""

STILL: Vector2 = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Gusts:
    """Slow random air movement that the velocity loop rejects only in part. Chosen."""

    sigma_m_s: float = 0.03
    time_constant_s: float = 2.0


@dataclass(frozen=True, slots=True)
class Follow:
    """Closed-loop response of one axis to its reference; fitted to measured steps."""

    natural_rad_s: float
    """Natural frequency of the closed loop, rad/s."""
    damping: float
    """Damping ratio of the closed loop."""
    slow_share: float
    """Share of a change that arrives late, 0 to 1."""
    slow_s: float
    """Time constant of the late share, s."""


@dataclass(frozen=True, slots=True)
class Airframe:
    """Response of all axes of one vehicle."""

    horizontal: Follow
    vertical: Follow
    yaw: Follow


class Loop:
    """One axis: v'' = ω²·(reference - v) - 2·ζ·ω·v'."""

    def __init__(self, follow: Follow) -> None:
        self._follow = follow
        self._slow = 0.0
        self.acceleration = 0.0
        self.velocity = 0.0

    def reset(self) -> None:
        self._slow = self.velocity = self.acceleration = 0.0

    def step(self, wanted: float) -> float:
        """Advance by one time step; return the velocity."""
        f = self._follow
        self._slow += (wanted - self._slow) * STEP_S / f.slow_s
        reference = (1 - f.slow_share) * wanted + f.slow_share * self._slow
        pull = f.natural_rad_s**2 * (reference - self.velocity)
        self.acceleration += (pull - 2 * f.damping * f.natural_rad_s * self.acceleration) * STEP_S
        self.velocity += self.acceleration * STEP_S
        return self.velocity


class Vehicle:
    """Simulates true motion. Commands are a velocity in the world's NED frame and a yaw rate."""

    def __init__(
        self, start: TrueState, random: Random, airframe: Airframe, gusts: Gusts = Gusts()
    ) -> None:
        self._random = random
        self._gusts = gusts
        self._steps = 0
        self._north, self._east = Loop(airframe.horizontal), Loop(airframe.horizontal)
        self._down, self._yaw = Loop(airframe.vertical), Loop(airframe.yaw)
        self._gust_ne = STILL
        self._floor = start.position_ned_m[2]
        self.wind_ne_m_s: Vector2 = STILL
        """A fault for tests: wind that moves the vehicle, north and east, m/s."""
        self.downwash_m_s = 0.0
        """Speed at which the air of a vehicle above pushes this one down, m/s."""
        self.state = start

    @property
    def on_ground(self) -> bool:
        return self.state.position_ned_m[2] >= self._floor

    def step(self, velocity_ned_m_s: Vector3, yaw_rate_rad_s: float) -> TrueState:
        """Advance by one time step towards a commanded velocity."""
        if self._steps % GUST_STEPS == 0:
            self._blow()
        wanted_n, wanted_e, wanted_d = velocity_ned_m_s
        gust_n, gust_e = self._gust_ne
        wind_n, wind_e = self.wind_ne_m_s
        north = self._north.step(wanted_n) + gust_n + wind_n
        east = self._east.step(wanted_e) + gust_e + wind_e
        wanted_rate = max(-MAX_YAW_RATE_RAD_S, min(MAX_YAW_RATE_RAD_S, yaw_rate_rad_s))
        turning = self._yaw.step(wanted_rate)
        accelerations = self._north.acceleration, self._east.acceleration
        down = self._down.step(wanted_d) + self.downwash_m_s
        return self._move((north, east, down), accelerations, turning)

    def _blow(self) -> None:
        """Draw the next gust, an Ornstein-Uhlenbeck process."""
        fade = GUST_STEPS * STEP_S / self._gusts.time_constant_s
        kick = self._gusts.sigma_m_s * math.sqrt(2 * fade)
        north, east = self._gust_ne
        north += -fade * north + self._random.gauss(0, kick)
        east += -fade * east + self._random.gauss(0, kick)
        self._gust_ne = north, east

    def rest(self) -> TrueState:
        """Advance by one time step with the motors off: still on the ground, in free fall above."""
        for loop in (self._north, self._east, self._down, self._yaw):
            loop.reset()
        falling = self.state.velocity_ned_m_s[2]
        if not self.on_ground:
            falling += GRAVITY_M_S2 * STEP_S
        return self._move((0.0, 0.0, falling), STILL, 0.0)

    def _move(
        self, velocity_ned_m_s: Vector3, acceleration_ne_m_s2: Vector2, yaw_rate_rad_s: float
    ) -> TrueState:
        """Advance by one time step, tilted into the acceleration."""
        was = self.state
        north, east, down = velocity_ned_m_s
        x, y, z = was.position_ned_m
        z += down * STEP_S
        if z >= self._floor:  # on the ground, without sliding
            z, down = self._floor, min(down, 0.0)
            north = east = yaw_rate_rad_s = 0.0
        yaw_rad = wrap_rad(was.yaw_rad + yaw_rate_rad_s * STEP_S)
        forward, right = ned_to_frd(*acceleration_ne_m_s2, yaw_rad)
        self._steps += 1
        self.state = TrueState(
            time_s=self._steps * STEP_S,
            position_ned_m=(x + north * STEP_S, y + east * STEP_S, z),
            velocity_ned_m_s=(north, east, down),
            roll_rad=math.atan2(right, GRAVITY_M_S2),
            pitch_rad=-math.atan2(forward, GRAVITY_M_S2),
            yaw_rad=yaw_rad,
            yaw_rate_rad_s=yaw_rate_rad_s,
        )
        return self.state
