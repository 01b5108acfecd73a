"""Tracks the true state of an external simulation from its ground truth messages.

Their latitude and longitude are in 1e-7 degrees, 11 mm: too coarse for ranges to a few millimetres.
The position is therefore predicted by the velocity and corrected towards each message.
"""

import math
from dataclasses import replace

from companion.core.frames import Vector3, wrap_rad
from sitl.autopilot.estimation.ground_truth import Place, offset_ned_m
from sitl.autopilot.streams import Message
from sitl.core.truth import TrueState

PULL = 0.2
"""Share of the difference that one message corrects. Chosen."""
JUMP_M = 0.5
"""A larger difference means that the simulation moved the vehicle, m. Chosen."""


class TruthTracker:
    """Tracks motion in the world frame, shifted to the start. Time is the simulator's."""

    def __init__(self, start: TrueState) -> None:
        self._start = start
        self._home: Place | None = None
        self.state = start

    @property
    def home(self) -> Place | None:
        """Location on Earth where the external simulation began; None before its first message."""
        return self._home

    def receive(self, message: Message, now_s: float) -> bool:
        """Process a message; True if it has the true state."""
        reported = _reported(message)
        if reported is None:
            return False
        place, state = reported
        if self._home is None:
            self._home = place
        there = offset_ned_m(self._home, place)
        began = self._start.position_ned_m
        reported_ned_m = (there[0] + began[0], there[1] + began[1], min(there[2], 0.0) + began[2])
        self.state = replace(
            state, time_s=now_s, position_ned_m=self._pulled(self.at(now_s), reported_ned_m)
        )
        return True

    def _pulled(self, predicted: TrueState, reported_ned_m: Vector3) -> Vector3:
        here = predicted.position_ned_m
        if math.dist(here, reported_ned_m) > JUMP_M:
            return reported_ned_m
        north, east, down = (h + PULL * (t - h) for h, t in zip(here, reported_ned_m, strict=True))
        return north, east, down

    def at(self, time_s: float) -> TrueState:
        """The state predicted from the last message."""
        state = self.state
        dt_s = time_s - state.time_s
        north, east, down = (
            p + v * dt_s for p, v in zip(state.position_ned_m, state.velocity_ned_m_s, strict=True)
        )
        return replace(
            state,
            time_s=time_s,
            position_ned_m=(north, east, min(down, self._start.position_ned_m[2])),
            yaw_rad=wrap_rad(state.yaw_rad + state.yaw_rate_rad_s * dt_s),
        )


def _reported(message: Message) -> tuple[Place, TrueState] | None:
    m = message
    match m.get_type():
        case "SIM_STATE":
            place = m.lat_int, m.lon_int, round(1000 * m.alt)
            attitude = m.roll, m.pitch, m.yaw
            return place, _state((m.vn, m.ve, m.vd), attitude, m.zgyro)
        case "HIL_STATE_QUATERNION":
            velocity = 0.01 * m.vx, 0.01 * m.vy, 0.01 * m.vz
            attitude = _roll_pitch_yaw(m.attitude_quaternion)
            return (m.lat, m.lon, m.alt), _state(velocity, attitude, m.yawspeed)
    return None


def _state(velocity_ned_m_s: Vector3, attitude: Vector3, yaw_rate_rad_s: float) -> TrueState:
    roll, pitch, yaw = attitude
    return TrueState(
        0.0, (0.0, 0.0, 0.0), velocity_ned_m_s, roll, pitch, wrap_rad(yaw), yaw_rate_rad_s
    )


def _roll_pitch_yaw(quaternion_wxyz: tuple[float, float, float, float]) -> Vector3:
    w, x, y, z = quaternion_wxyz
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x)))),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )
