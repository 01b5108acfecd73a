"""Odometry out of LOCAL_POSITION_NED (32) and ATTITUDE (30), carried to the present moment.

An autopilot sends the two when it has time, and they are read once a tick: by then the vehicle has
flown on by centimetres. Both are stamped with the autopilot's own time since boot, which
`BootClock` follows.

An autopilot that is told our pose follows it: how its position changes then tells us back what we
said. Its velocity hardly does, so that motion is taken from it instead.

Its heading may be pulled by what its estimator takes in: PX4's by 6 to 14° at take-off, ArduPilot's
by a step of 3° when it aligns in flight. What it has turned are its rates, added up over its own
time; by how much the heading has gone beyond them is told beside it.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.boot_clock import BootClock
from companion.core.frames import Vector2, Vector3, wrap_rad
from companion.core.messages import Odometry
from companion.link.transports.transport import Message

POSITION_HZ = 20.0
ATTITUDE_HZ = 25.0
"""Not in step with our ticks, so that now and then a message comes without waiting for one."""
MAX_EXTRAPOLATION_S = 0.2
MAX_BETWEEN_RATES_S = 0.1
"""Rates farther apart than two messages do not tell the turn between them."""
RESTARTED_MS = 2000
"""No message is overtaken by one that is so much younger."""


class OdometryReader:
    """The latest of both messages; time is an argument."""

    def __init__(self, *, follows_us: bool) -> None:
        """`follows_us`: it is told our pose; north and east are what the velocity adds up to."""
        self._follows_us = follows_us
        self._travelled_ne_m: Vector2 = (0.0, 0.0)
        self._pulled_rad = 0.0
        self.start_over()

    def start_over(self) -> None:
        """Its clock begins anew; what it has moved and turned so far stays."""
        self._position: Message | None = None
        self._attitude: Message | None = None
        self._clock = BootClock()
        self._newest_ms: dict[int, int] = {}
        """By message id, since the clock was set."""
        self._is_in_order = True

    @property
    def has_position(self) -> bool:
        return self._position is not None

    @property
    def told(self) -> tuple[Vector3, float] | None:
        """Position and yaw as the autopilot last told them; the origin if it has no position yet.

        An autopilot that has only us to go by has none until we begin.
        """
        if self._attitude is None:
            return None
        at = self._position
        return (at.x, at.y, at.z) if at is not None else (0.0, 0.0, 0.0), self._attitude.yaw

    def has_restarted(self, message: Message) -> bool:
        """The autopilot's clock has begun anew, or was set back."""
        known = (m.time_boot_ms for m in (self._position, self._attitude) if m is not None)
        return bool(message.time_boot_ms < max(known, default=0) - RESTARTED_MS)

    def read(self, message: Message, now_s: float) -> Odometry | None:
        """Odometry of now, if this was a position newer than the last."""
        if self._clock.hear(message.time_boot_ms * 1e-3, now_s):
            self._newest_ms.clear()
        is_newer = message.time_boot_ms > self._newest_ms.get(message.get_msgId(), -math.inf)
        if is_newer:
            self._newest_ms[message.get_msgId()] = message.time_boot_ms
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_ATTITUDE:
            if is_newer:
                self._turn(self._attitude, message)
                self._attitude = message
            self._is_in_order = is_newer
            return None
        if not is_newer:
            return None
        if self._position is not None:
            self._travel(self._position, message)
        self._position = message
        both = mavlink.MAVLINK_MSG_ID_ATTITUDE in self._newest_ms
        return self._carried_to(now_s) if both else None

    def _turn(self, last: Message | None, message: Message) -> None:
        """By how much the heading has gone beyond what the rates before and after come to.

        Between the two, the rate may have changed early or late. Where stamps are out of order or
        leap, the time between is not known.
        """
        dt_s = (message.time_boot_ms - last.time_boot_ms) * 1e-3 if last is not None else 0.0
        if last is None or not self._is_in_order or not 0 < dt_s <= MAX_BETWEEN_RATES_S:
            return
        turned_rad = 0.5 * (last.yawspeed + message.yawspeed) * dt_s
        unsure_rad = 0.5 * abs(message.yawspeed - last.yawspeed) * dt_s
        beyond_rad = wrap_rad(message.yaw - last.yaw - turned_rad)
        pulled_rad = math.copysign(max(abs(beyond_rad) - unsure_rad, 0.0), beyond_rad)
        self._pulled_rad = wrap_rad(self._pulled_rad + pulled_rad)

    def _travel(self, last: Message, message: Message) -> None:
        dt_s = max(message.time_boot_ms - last.time_boot_ms, 0) * 1e-3
        north_m, east_m = self._travelled_ne_m
        north_m += 0.5 * (last.vx + message.vx) * dt_s
        east_m += 0.5 * (last.vy + message.vy) * dt_s
        self._travelled_ne_m = north_m, east_m

    def _carried_to(self, now_s: float) -> Odometry | None:
        position, attitude = self._position, self._attitude
        assert position is not None
        assert attitude is not None
        position_age_s, attitude_age_s = (
            now_s - self._clock.time_s(m.time_boot_ms * 1e-3) for m in (position, attitude)
        )
        if max(abs(position_age_s), abs(attitude_age_s)) > MAX_EXTRAPOLATION_S:
            return None
        velocity = position.vx, position.vy, position.vz
        ne_m = self._travelled_ne_m if self._follows_us else (position.x, position.y)
        north, east, down = (
            value + rate * position_age_s
            for value, rate in zip((*ne_m, position.z), velocity, strict=True)
        )
        yaw_rad = wrap_rad(attitude.yaw + attitude.yawspeed * attitude_age_s)
        at_ned_m = north, east, down
        return Odometry(now_s, at_ned_m, velocity, yaw_rad, self._follows_us, self._pulled_rad)
