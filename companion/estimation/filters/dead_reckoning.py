"""Dead reckoning by odometry and gyro alone: it drifts slowly and never jumps."""

import math

from companion.core.frames import Vector2, frd_to_ned


class DeadReckoning:
    """A position and a heading that only integrate motion."""

    def __init__(self) -> None:
        self.ne_m: Vector2 = (0.0, 0.0)
        self.yaw_rad = 0.0

    def turn(self, turned_rad: float) -> None:
        self.yaw_rad += turned_rad

    def move(self, body_m: Vector2, half_turn_rad: float) -> None:
        """Move by the body displacement (forward, right).

        `half_turn_rad` is half the turn in that time.
        """
        self.ne_m = moved(self.ne_m, body_m, self.yaw_rad - half_turn_rad)


def moved(ne_m: Vector2, body_m: Vector2, yaw_rad: float) -> Vector2:
    """A position moved by (forward, right) at a heading."""
    north_m, east_m = frd_to_ned(*body_m, yaw_rad)
    return ne_m[0] + north_m, ne_m[1] + east_m


def along(origin_ne_m: Vector2, bearing_rad: float, range_m: float) -> Vector2:
    """The end of a beam."""
    return (
        origin_ne_m[0] + range_m * math.cos(bearing_rad),
        origin_ne_m[1] + range_m * math.sin(bearing_rad),
    )
