"""A surface as one beam has followed it: where its next reading should end.

What a beam has met in the last second or two lies on a line, as walls do, and the drone's own
motion says where the beam should meet it now. A triangulating sensor that folds back reads as if
the surface suddenly moved away, faster than the drone moves; only its alias goes on along the line.
"""

import math
from collections import deque

import numpy as np

from companion.frames import Vector2

KEPT_S = 1.5
LEAST_POINTS = 8
LEAST_LENGTH_M = 0.15
"""A shorter track tells no direction: the surface is taken to be square to the beam."""
MOST_OFF_LINE_M = 0.03
MOST_OBLIQUE = math.cos(math.radians(60))


class Track:
    """Ends of one beam, in a frame that odometry moves on; the newest last."""

    def __init__(self) -> None:
        self._ends: deque[tuple[float, float, float]] = deque()

    def add(self, time_s: float, end_ne_m: Vector2) -> None:
        self._ends.append((time_s, *end_ne_m))

    def ahead_m(self, time_s: float, from_ne_m: Vector2, bearing_rad: float) -> float:
        """From there along a bearing to the surface, metres; NaN if no track tells."""
        while self._ends and self._ends[0][0] < time_s - KEPT_S:
            self._ends.popleft()
        if len(self._ends) < LEAST_POINTS:
            return math.nan
        ends = np.array(self._ends)[:, 1:]
        centre = ends.mean(axis=0)
        beam = np.array((math.cos(bearing_rad), math.sin(bearing_rad)))
        off = ends - centre
        (across_m2, along_m2), axes = np.linalg.eigh(off.T @ off / len(ends))
        if math.sqrt(max(across_m2, 0.0)) > MOST_OFF_LINE_M:
            return math.nan
        is_long = math.sqrt(12 * along_m2) > LEAST_LENGTH_M
        normal = axes[:, 0] if is_long else beam
        if abs(float(normal @ beam)) < MOST_OBLIQUE:
            return math.nan
        return float((centre - from_ne_m) @ normal / (beam @ normal))
