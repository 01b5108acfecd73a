"""Does a range sensor scatter more than its kind does? Wald's sequential probability ratio test.

Three readings in a row lie on a straight line, but for their noise. One that does not is *rough*.
Each adds the logarithm of how much likelier it is from a sensor with ten times the noise than from
a sound one; a sum that is large enough condemns the sensor, and none is below zero (Page's CUSUM).

A sound sensor's readings do not lie on a line, either, where its beam swings over legs and gaps: it
meets one, then the other. So a reading tells the less the farther the beam's end has moved aside,
up to the width of a leg from reading to reading. Along an edge a beam that stands still meets now
what is before it, now what is behind it, but each again and again.
"""

import math
from collections import deque

from companion.core.messages import RangeReading

ROUGH_SIGMAS = 6.0
"""Of the second difference, which has a sigma of √6 if the sensor is sound."""
KNOWN_SIGMAS, KNOWN_BY, KNOWN_OF = 2.0, 4, 20
"""A reading is not rough that agrees so closely with so many of so many before; nothing is known
before there are so many."""
ROUGH_IF_NOISY = 0.81
"""Share of rough readings with ten times the noise: P(|z| > 6 / (10·√6))."""
ROUGH_AT_REST = 0.10
"""Share of rough readings of a sound sensor whose beam stands still; 0.04 among 70 posts of 5 cm
in 5.5 × 5.5 m, the rest is for who walks by."""
ROUGH_IN_CLUTTER, LEG_M = 0.55, 0.045
"""Share of a sound sensor whose beam moves on by a leg or more: 0.10 to 0.19 in five flights at
clutter 0.75 and 1.0, 0.65 in their worst two seconds. Only more than 0.69 speaks against it."""
CONDEMNED, MAX_SUM = 11.0, 15.0
"""Sum of logarithms: 60,000 to 1, and as far as it goes. Three flights among 70 posts came to 10.4;
ten times the noise was found within 50 s in 25 of 27 flights, in most of them within 5 s, at rest
after 0.5 s."""
MEMORY_S = 10.0
"""After which what was seen counts a third: a sensor that meets nothing tells nothing new. Chosen,
twice as long as it takes to find one."""


class Scatter:
    """Of one sensor."""

    def __init__(self) -> None:
        self._last_m: tuple[float, float] = (math.nan, math.nan)
        """The two distances before."""
        self._last_aside_m = 0.0
        self._lately_m: deque[float] = deque(maxlen=KNOWN_OF)
        self._sum = 0.0
        self._seen_s = -math.inf

    @property
    def is_too_much(self) -> bool:
        return self._sum > CONDEMNED

    def pause(self) -> None:
        """The next reading is no neighbour of the last."""
        self._last_m = (math.nan, math.nan)

    def take(self, time_s: float, reading: RangeReading, aside_m: float) -> None:
        """Take in a reading; the beam's end has moved aside by `aside_m` since the one before."""
        self._sum *= math.exp((self._seen_s - time_s) / MEMORY_S)
        self._seen_s = time_s
        before_m, middle_m = self._last_m
        now_m = reading.distance_m if reading.is_distance else math.nan
        moved_m, self._last_aside_m = 0.5 * (self._last_aside_m + aside_m), aside_m
        self._last_m = middle_m, now_m
        off_m = abs(before_m - 2 * middle_m + now_m)
        sigma_m = math.sqrt(reading.variance_m2)
        known_by = sum(abs(m - now_m) < KNOWN_SIGMAS * sigma_m for m in self._lately_m)
        is_new = len(self._lately_m) < KNOWN_OF
        self._lately_m.append(now_m)
        if is_new or math.isnan(off_m):
            return
        is_rough = off_m > ROUGH_SIGMAS * sigma_m and known_by < KNOWN_BY
        self._sum = min(max(0.0, self._sum + _log_ratio(moved_m, is_rough=is_rough)), MAX_SUM)


def _log_ratio(moved_m: float, *, is_rough: bool) -> float:
    """How much likelier from a noisy sensor than from a sound one."""
    share = min(1.0, moved_m / LEG_M)
    sound = ROUGH_AT_REST + share * (ROUGH_IN_CLUTTER - ROUGH_AT_REST)
    return math.log(ROUGH_IF_NOISY / sound if is_rough else (1 - ROUGH_IF_NOISY) / (1 - sound))
