"""Odometry out of LOCAL_POSITION_NED (32) and ATTITUDE (30), carried to the present moment.

An autopilot sends the two when it has time, and they are read once a tick: by then the vehicle has
flown on by centimetres. Both are stamped with the autopilot's own time since boot. How far that
lies behind our clock is seen from the quickest message so far.

An autopilot that is told our pose follows it: how its position changes then tells us back what we
said. Its velocity hardly does, so that motion is taken from it instead.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.frames import Vector2, Vector3, wrap_rad
from companion.link.transport import Message
from companion.messages import Odometry

POSITION_HZ = 20.0
ATTITUDE_HZ = 25.0
"""Not in step with our ticks, so that now and then a message comes without waiting for one."""
CLOCK_DRIFT = 50e-6
"""Two quartzes part by no more; the offset is let go at this rate, s/s."""
MOST_EARLIER_S = 0.05
"""The offset falls by no more in one tick: if we are paused between looking at our clock and
reading what has come, messages seem to be from the future."""
MOST_EXTRAPOLATION_S = 0.2
LATE_S = 0.25
"""When all messages have been late, or early, for so long, it is not the radio: its clock was set,
or has lagged, as that of a simulator on a busy machine does again and again. Until then there is no
odometry, which must not be for so long that the flight is broken off."""
RESTARTED_MS = 2000
"""No message is overtaken by one that is so much younger."""


class OdometryReader:
    """The latest of both messages; time is an argument."""

    def __init__(self, *, follows_us: bool) -> None:
        """`follows_us`: it is told our pose; north and east are what the velocity adds up to."""
        self._follows_us = follows_us
        self._travelled_ne_m: Vector2 = (0.0, 0.0)
        self._position: Message | None = None
        self._attitude: Message | None = None
        self._offset_s = self._least_offset_s = float("inf")
        self._heard_s = self._in_time_s = 0.0

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
        boot_s = message.time_boot_ms * 1e-3
        self._note_quickest(now_s, now_s - boot_s)
        if abs(now_s - boot_s - self._offset_s) <= MOST_EXTRAPOLATION_S:
            self._in_time_s = now_s
        elif now_s - self._in_time_s > LATE_S:  # its clock stood still, or was set
            self._offset_s, self._in_time_s = now_s - boot_s, now_s
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_ATTITUDE:
            if _is_newer(message, self._attitude):
                self._attitude = message
            return None
        if not _is_newer(message, self._position):
            return None
        if self._position is not None:
            self._travel(self._position, message)
        self._position = message
        return self._carried_to(now_s) if self._attitude is not None else None

    def _note_quickest(self, now_s: float, offset_s: float) -> None:
        if math.isinf(self._offset_s):
            self._offset_s = offset_s
        if now_s != self._heard_s:
            self._offset_s += CLOCK_DRIFT * (now_s - self._heard_s)
            self._least_offset_s = self._offset_s - MOST_EARLIER_S
            self._heard_s = now_s
        self._offset_s = min(self._offset_s, max(offset_s, self._least_offset_s))

    def _travel(self, last: Message, message: Message) -> None:
        dt_s = (message.time_boot_ms - last.time_boot_ms) * 1e-3
        north_m, east_m = self._travelled_ne_m
        north_m += 0.5 * (last.vx + message.vx) * dt_s
        east_m += 0.5 * (last.vy + message.vy) * dt_s
        self._travelled_ne_m = north_m, east_m

    def _carried_to(self, now_s: float) -> Odometry | None:
        position, attitude = self._position, self._attitude
        assert position is not None
        assert attitude is not None
        position_age_s = now_s - self._offset_s - position.time_boot_ms * 1e-3
        attitude_age_s = now_s - self._offset_s - attitude.time_boot_ms * 1e-3
        if max(abs(position_age_s), abs(attitude_age_s)) > MOST_EXTRAPOLATION_S:
            return None
        velocity = position.vx, position.vy, position.vz
        ne_m = self._travelled_ne_m if self._follows_us else (position.x, position.y)
        north, east, down = (
            value + rate * position_age_s
            for value, rate in zip((*ne_m, position.z), velocity, strict=True)
        )
        yaw_rad = wrap_rad(attitude.yaw + attitude.yawspeed * attitude_age_s)
        return Odometry(now_s, (north, east, down), velocity, yaw_rad, self._follows_us)


def _is_newer(message: Message, than: Message | None) -> bool:
    return than is None or message.time_boot_ms > than.time_boot_ms
