"""Computes odometry from LOCAL_POSITION_NED (32) and ATTITUDE (30), extrapolated to now.

The autopilot sends both messages at its own times, and the companion reads them once per tick: the
vehicle has moved by centimetres in between. Both carry the autopilot's time since boot, which
`BootClock` converts.

An autopilot that receives our pose follows it, so changes of its position only repeat our own
estimate. Its velocity hardly depends on our pose. In this case the motion is the integral of the
velocity.

The autopilot's estimator may correct its heading without a turn: PX4 by 6 to 14° at take-off,
ArduPilot by a step of 3° when it aligns in flight. The true turn is the integral of the yaw rate
over the autopilot's time. The sum of the corrections beyond it is reported beside the heading.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.boot_clock import BootClock
from companion.core.frames import Vector2, Vector3, wrap_rad
from companion.core.messages import Odometry
from companion.link.transports.transport import Message

POSITION_HZ = 20.0
"""Requested rate of LOCAL_POSITION_NED (32), Hz. Chosen."""
ATTITUDE_HZ = 25.0
"""Requested rate of ATTITUDE (30), Hz.

Chosen: not synchronous with the ticks, so that now and then a message arrives just before a tick.
"""
MAX_EXTRAPOLATION_S = 0.2
"""Maximum age of a message that is extrapolated to now, s. Chosen."""
MAX_BETWEEN_RATES_S = 0.1
"""Maximum time between two yaw rates that are integrated, s.

Chosen: with more than two message periods between them, two rates do not determine the turn.
"""
RESTARTED_MS = 2000
"""Step back of the autopilot's time that means a restart, ms.

Chosen: messages out of order differ by less.
"""


class OdometryReader:
    """Holds the latest of both messages; time is an argument."""

    def __init__(self, *, follows_us: bool) -> None:
        """`follows_us`: the autopilot receives our pose; north and east integrate its velocity."""
        self._follows_us = follows_us
        self._travelled_ne_m: Vector2 = (0.0, 0.0)
        self._pulled_rad = 0.0
        self.start_over()

    def start_over(self) -> None:
        """Reset the autopilot's clock; the integrated motion and corrections are kept."""
        self._position: Message | None = None
        self._attitude: Message | None = None
        self._clock = BootClock()
        self._newest_ms: dict[int, int] = {}
        """By message id: the latest time since boot after the clock was set, ms."""
        self._is_in_order = True

    @property
    def missing(self) -> str:
        """Name of a message that has not been received yet; empty if both have been."""
        if self._position is None:
            return "LOCAL_POSITION_NED"
        return "ATTITUDE" if self._attitude is None else ""

    @property
    def told(self) -> tuple[Vector3, float] | None:
        """Latest position (local NED, m) and yaw (rad) from the autopilot.

        The position is the origin while the autopilot has none: without another position source it
        has none until the companion sends poses. None before the first ATTITUDE.
        """
        if self._attitude is None:
            return None
        at = self._position
        return (at.x, at.y, at.z) if at is not None else (0.0, 0.0, 0.0), self._attitude.yaw

    def has_restarted(self, message: Message) -> bool:
        """True if the autopilot's clock has restarted or was set back."""
        known = (m.time_boot_ms for m in (self._position, self._attitude) if m is not None)
        return bool(message.time_boot_ms < max(known, default=0) - RESTARTED_MS)

    def read(self, message: Message, now_s: float) -> Odometry | None:
        """Odometry at `now_s`, if the message is a newer position than the last; else None.

        A message with a value that is not finite is ignored: sums would keep it for ever.
        """
        if not _is_finite(message):
            return None
        if self._clock.receive(message.time_boot_ms * 1e-3, now_s):
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
        """Add the change of heading that the yaw rates before and after do not explain.

        The rate may have changed at any time between the two messages, which bounds the turn. The
        step is skipped where time stamps are out of order or jump: the time between is unknown.
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


def _is_finite(message: Message) -> bool:
    return all(math.isfinite(getattr(message, name)) for name in message.fieldnames)
