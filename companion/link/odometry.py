"""Odometry out of LOCAL_POSITION_NED (32) and ATTITUDE (30), carried to the present moment.

An autopilot sends the two when it has time, and they are read once a tick: by then the vehicle has
flown on by centimetres. Both are stamped with the autopilot's own time since boot. How far that
lies behind our clock is seen from the quickest message so far.
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.frames import wrap_rad
from companion.link.transport import Message
from companion.messages import Odometry

POSITION_HZ = 20.0
ATTITUDE_HZ = 25.0
"""Not in step with our ticks, so that now and then a message comes without waiting for one."""
CLOCK_DRIFT = 50e-6
"""Two quartzes part by no more; the offset is let go at this rate, s/s."""
MOST_EXTRAPOLATION_S = 0.2


class OdometryReader:
    """The latest of both messages; time is an argument."""

    def __init__(self) -> None:
        self._position: Message | None = None
        self._attitude: Message | None = None
        self._offset_s = float("inf")
        self._heard_s = 0.0

    @property
    def has_position(self) -> bool:
        return self._position is not None

    def read(self, message: Message, now_s: float) -> Odometry | None:
        """Odometry of now, if this was a position newer than the last."""
        boot_s = message.time_boot_ms * 1e-3
        self._offset_s += CLOCK_DRIFT * (now_s - self._heard_s)
        self._offset_s = min(self._offset_s, now_s - boot_s)
        self._heard_s = now_s
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_ATTITUDE:
            if _is_newer(message, self._attitude):
                self._attitude = message
            return None
        if not _is_newer(message, self._position):
            return None
        self._position = message
        return self._carried_to(now_s) if self._attitude is not None else None

    def _carried_to(self, now_s: float) -> Odometry | None:
        position, attitude = self._position, self._attitude
        assert position is not None
        assert attitude is not None
        position_age_s = now_s - self._offset_s - position.time_boot_ms * 1e-3
        attitude_age_s = now_s - self._offset_s - attitude.time_boot_ms * 1e-3
        if max(position_age_s, attitude_age_s) > MOST_EXTRAPOLATION_S:
            return None
        velocity = position.vx, position.vy, position.vz
        north, east, down = (
            value + rate * position_age_s
            for value, rate in zip((position.x, position.y, position.z), velocity, strict=True)
        )
        yaw_rad = wrap_rad(attitude.yaw + attitude.yawspeed * attitude_age_s)
        return Odometry(now_s, (north, east, down), velocity, yaw_rad)


def _is_newer(message: Message, than: Message | None) -> bool:
    return than is None or message.time_boot_ms > than.time_boot_ms
