"""The quadrotor as a moving point with a heading, in 10 ms steps.

Velocity follows its setpoint as measured on ArduCopter: a step of 1 m/s reaches 0.84 after 1 s
and 0.95 after 2 s. Two first-order parts fit that: most of it quick, the rest an integrator's
slow tail. At rest on the ground the body's centre is at down = 0.
"""

import math
from dataclasses import dataclass
from random import Random

from companion.frames import Vector2, Vector3, ned_to_frd, wrap_rad
from sitl.truth import TrueState

STEP_S = 0.01
GUST_STEPS = 5
QUICK_SHARE, QUICK_S, SLOW_S = 0.86, 0.42, 2.0
SLOW_SHARE = 1 - QUICK_SHARE
CLIMB_S = 0.35
YAW_S = 0.15
MOST_YAW_RATE_RAD_S = math.radians(90)
GRAVITY_M_S2 = 9.81
BRAKING_M_S2 = 2.7
"""Of the commanded velocity when setpoints stop; with the response above the drone slows from
1.0 to about 0.54 m/s in 0.5 s, as ArduCopter does."""

STILL: Vector2 = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Gusts:
    """Slow random air movement that the velocity loop only partly holds against."""

    sigma_m_s: float = 0.03
    time_constant_s: float = 2.0


class Vehicle:
    """True motion. Commands are velocities in the world's NED and a yaw rate."""

    def __init__(self, start: TrueState, random: Random, gusts: Gusts = Gusts()) -> None:
        self._random = random
        self._gusts = gusts
        self._steps = 0
        self._quick_ne = self._slow_ne = self._gust_ne = STILL
        self._floor = start.position_ned_m[2]
        self.wind_ne_m_s: Vector2 = STILL
        """A fault for tests: a gust that carries the vehicle along."""
        self.state = start

    @property
    def on_ground(self) -> bool:
        return self.state.position_ned_m[2] >= self._floor

    def step(self, velocity_ned_m_s: Vector3, yaw_rate_rad_s: float) -> TrueState:
        """Fly for one step towards a commanded velocity."""
        if self._steps % GUST_STEPS == 0:
            self._blow()
        north, east, down = velocity_ned_m_s
        (quick_n, quick_e), (slow_n, slow_e) = self._quick_ne, self._slow_ne
        quick_n += (north - quick_n) * STEP_S / QUICK_S
        quick_e += (east - quick_e) * STEP_S / QUICK_S
        slow_n += (north - slow_n) * STEP_S / SLOW_S
        slow_e += (east - slow_e) * STEP_S / SLOW_S
        self._quick_ne, self._slow_ne = (quick_n, quick_e), (slow_n, slow_e)
        gust_n, gust_e = self._gust_ne
        wind_n, wind_e = self.wind_ne_m_s
        north = QUICK_SHARE * quick_n + SLOW_SHARE * slow_n + gust_n + wind_n
        east = QUICK_SHARE * quick_e + SLOW_SHARE * slow_e + gust_e + wind_e
        was_north, was_east, sinking = self.state.velocity_ned_m_s
        sinking += (down - sinking) * STEP_S / CLIMB_S
        turning = self.state.yaw_rate_rad_s
        wanted_rate = max(-MOST_YAW_RATE_RAD_S, min(MOST_YAW_RATE_RAD_S, yaw_rate_rad_s))
        turning += (wanted_rate - turning) * STEP_S / YAW_S
        acceleration_ne = (north - was_north) / STEP_S, (east - was_east) / STEP_S
        return self._move((north, east, sinking), acceleration_ne, turning)

    def _blow(self) -> None:
        """Ornstein-Uhlenbeck process."""
        fade = GUST_STEPS * STEP_S / self._gusts.time_constant_s
        kick = self._gusts.sigma_m_s * math.sqrt(2 * fade)
        north, east = self._gust_ne
        north += -fade * north + self._random.gauss(0, kick)
        east += -fade * east + self._random.gauss(0, kick)
        self._gust_ne = north, east

    def rest(self) -> TrueState:
        """One step with the motors off: on the ground it stays; in the air it falls."""
        self._quick_ne = self._slow_ne = STILL
        falling = self.state.velocity_ned_m_s[2]
        if not self.on_ground:
            falling += GRAVITY_M_S2 * STEP_S
        return self._move((0.0, 0.0, falling), STILL, 0.0)

    def _move(
        self, velocity_ned_m_s: Vector3, acceleration_ne_m_s2: Vector2, yaw_rate_rad_s: float
    ) -> TrueState:
        """On for one step, tilted into the acceleration."""
        was = self.state
        north, east, down = velocity_ned_m_s
        x, y, z = was.position_ned_m
        z += down * STEP_S
        if z >= self._floor:
            z, down = self._floor, min(down, 0.0)
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
