"""Tells whether a beam that turns has followed a straight wall.

In a turn, the readings of a wall lie on a straight line. Readings of a nearer wall that have folded
back lie on a curve. Without a turn the two cannot be told: beside a drone in straight flight, the
far image of a wall that comes near is almost straight, too.
"""

import math
from collections import deque

import numpy as np

from companion.core.frames import Vector2

KEPT_S = 1.0
"""Time for which ends are kept, s. Chosen: longer, the beam has left the wall that it follows."""
LEAST_TURN_RAD = math.radians(30)
STRAIGHT_M = 0.025
"""Least turn, and largest root mean square distance of the ends from a line, m.

Computed for a gp2y0a710k0f that turns by 30° or more towards a wall at 0.25 to 0.44 m from the
sensor, also with 0.8 m of motion along it in each radian: the ends of the folded readings are
0.065 m or more off a line. Measured in 552 s in corridors of 1 m: at least 0.054 m.
"""
LEAST_TO_WALL_M = 0.3
"""Least distance of the drone's centre from the line, m. Chosen: a body's radius and margin. A line
that passes nearer is that of an obstacle straight ahead."""


class BeamTrack:
    """Ends of one beam in the last sweeps, in the frame of the odometry."""

    def __init__(self) -> None:
        self._ends: deque[tuple[float, float, float, float]] = deque()
        """Time, s, north and east, m, and the drone's heading, rad, in the order of time."""

    def clear(self) -> None:
        """Forget all ends: the beam has left its obstacle, or the obstacle changed sides."""
        self._ends.clear()

    def add(self, now_s: float, end_ne_m: Vector2, yaw_rad: float) -> None:
        """Add the end of the beam in this sweep."""
        while self._ends and self._ends[0][0] < now_s - KEPT_S:
            self._ends.popleft()
        self._ends.append((now_s, *end_ne_m, yaw_rad))

    def is_wall(self, from_ne_m: Vector2) -> bool:
        """Return True if the beam turned enough, and its ends lie on a line beside the drone."""
        _, north_m, east_m, yaw_rad = np.array(self._ends).T
        if np.ptp(np.unwrap(yaw_rad)) < LEAST_TURN_RAD:
            return False
        ends_ne_m = np.column_stack([north_m, east_m])
        middle_ne_m = ends_ne_m.mean(axis=0)
        _, lengths_m, axes_ne = np.linalg.svd(ends_ne_m - middle_ne_m, full_matrices=False)
        off_m = lengths_m[-1] / math.sqrt(len(ends_ne_m))
        to_wall_m = abs(float(axes_ne[-1] @ (from_ne_m - middle_ne_m)))
        return bool(off_m <= STRAIGHT_M) and to_wall_m >= LEAST_TO_WALL_M
