"""The quadrotor as a moving point with a heading, in 10 ms steps.

Velocity follows its setpoint as measured on ArduCopter: a step of 1 m/s reaches 0.84 after 1 s
and 0.95 after 2 s. Two first-order parts fit that: most of it quick, the rest an integrator's
slow tail. At rest on the ground the body's centre is at down = 0.
"""

import math
from dataclasses import dataclass
from random import Random

from companion.frames import Vector3, wrap_rad
from sitl.truth import TrueState

STEP_S = 0.01
GUST_STEPS = 5
QUICK_SHARE, QUICK_S, SLOW_S = 0.86, 0.42, 2.0
CLIMB_S = 0.35
YAW_S = 0.15
MOST_YAW_RATE_RAD_S = math.radians(90)
GRAVITY_M_S2 = 9.81
BRAKING_M_S2 = 2.7
"""Of the commanded velocity when setpoints stop; with the response above the drone slows from
1.0 to about 0.54 m/s in 0.5 s, as ArduCopter does."""


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
        self._position = list(start.position_ned_m)
        self._quick = [0.0, 0.0]
        self._slow = [0.0, 0.0]
        self._gust = [0.0, 0.0]
        self._velocity = [0.0, 0.0, 0.0]
        self._yaw_rad = start.yaw_rad
        self._yaw_rate = 0.0
        self._floor = start.position_ned_m[2]
        self.state = start

    @property
    def on_ground(self) -> bool:
        return self._position[2] >= self._floor

    def step(self, velocity_ned_m_s: Vector3, yaw_rate_rad_s: float) -> TrueState:
        """Fly for one step towards a commanded velocity."""
        before = self._velocity[0], self._velocity[1]
        if self._steps % GUST_STEPS == 0:
            self._blow()
        for axis in (0, 1):
            wanted = velocity_ned_m_s[axis]
            self._quick[axis] += (wanted - self._quick[axis]) * STEP_S / QUICK_S
            self._slow[axis] += (wanted - self._slow[axis]) * STEP_S / SLOW_S
            settled = QUICK_SHARE * self._quick[axis] + (1 - QUICK_SHARE) * self._slow[axis]
            self._velocity[axis] = settled + self._gust[axis]
        self._velocity[2] += (velocity_ned_m_s[2] - self._velocity[2]) * STEP_S / CLIMB_S
        wanted_rate = max(-MOST_YAW_RATE_RAD_S, min(MOST_YAW_RATE_RAD_S, yaw_rate_rad_s))
        self._yaw_rate += (wanted_rate - self._yaw_rate) * STEP_S / YAW_S
        self._move()
        return self._publish(before)

    def _blow(self) -> None:
        """Ornstein-Uhlenbeck process."""
        fade = GUST_STEPS * STEP_S / self._gusts.time_constant_s
        kick = self._gusts.sigma_m_s * math.sqrt(2 * fade)
        for axis in (0, 1):
            self._gust[axis] += -fade * self._gust[axis] + self._random.gauss(0, kick)

    def _move(self) -> None:
        for axis in (0, 1, 2):
            self._position[axis] += self._velocity[axis] * STEP_S
        self._yaw_rad += self._yaw_rate * STEP_S
        if self._position[2] >= self._floor:
            self._touch_ground()

    def _touch_ground(self) -> None:
        self._position[2] = self._floor
        self._velocity[2] = min(self._velocity[2], 0.0)

    def rest(self) -> TrueState:
        """One step with the motors off: on the ground it stays; in the air it falls."""
        for axis in (0, 1):
            self._quick[axis] = self._slow[axis] = self._velocity[axis] = 0.0
        self._yaw_rate = 0.0
        if not self.on_ground:
            self._velocity[2] += GRAVITY_M_S2 * STEP_S
        self._move()
        return self._publish((0.0, 0.0))

    def _publish(self, velocity_before: tuple[float, float]) -> TrueState:
        self._steps += 1
        north = (self._velocity[0] - velocity_before[0]) / STEP_S
        east = (self._velocity[1] - velocity_before[1]) / STEP_S
        cos_yaw, sin_yaw = math.cos(self._yaw_rad), math.sin(self._yaw_rad)
        forward, right = cos_yaw * north + sin_yaw * east, cos_yaw * east - sin_yaw * north
        x, y, z = self._position
        vx, vy, vz = self._velocity
        self.state = TrueState(
            time_s=self._steps * STEP_S,
            position_ned_m=(x, y, z),
            velocity_ned_m_s=(vx, vy, vz),
            roll_rad=math.atan2(right, GRAVITY_M_S2),
            pitch_rad=-math.atan2(forward, GRAVITY_M_S2),
            yaw_rad=wrap_rad(self._yaw_rad),
            yaw_rate_rad_s=self._yaw_rate,
        )
        return self.state
