"""Dead reckoning by odometry and gyro alone: it drifts slowly and never jumps."""

from companion.core.frames import Vector2, moved


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
