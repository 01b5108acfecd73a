"""Detects a noisy range sensor with Wald's sequential probability ratio test.

Three successive readings lie on a straight line, except for noise. A reading that does not is
*rough*. Each reading adds a log-likelihood ratio: a sensor with ten times the noise against a sound
one. A sum above the threshold condemns the sensor. The sum is never below zero (Page's CUSUM).

A sound sensor is rough too where its beam swings over legs and gaps. So a reading counts less, the
farther the beam's end has moved aside, up to the width of a leg between readings. At an edge, a
beam that does not move alternates between the distances before and behind it. These distances
repeat.
"""

import math
from collections import deque

from companion.core.messages import RangeReading

ROUGH_SIGMAS = 6.0
"""Threshold of the second difference for a rough reading, in sigmas of a reading. The second
difference of a sound sensor has a sigma of √6. Chosen."""
KNOWN_SIGMAS, KNOWN_BY, KNOWN_OF = 2.0, 4, 20
"""A reading is not rough if it agrees, within so many sigmas, with at least the second of the last
`KNOWN_OF` readings. The test starts after `KNOWN_OF` readings. Chosen."""
ROUGH_IF_NOISY = 0.81
"""Share of rough readings with ten times the noise: P(|z| > 6 / (10·√6))."""
ROUGH_AT_REST = 0.10
"""Share of rough readings of a sound sensor with a beam that does not move. Measured: 0.04 among 70
posts of 5 cm in 5.5 × 5.5 m. The rest is a margin for people who walk by."""
ROUGH_IN_CLUTTER, LEG_M = 0.55, 0.045
"""Share of rough readings of a sound sensor whose beam moves by a leg's width, m, or more.
Measured: 0.10 to 0.19 in five flights at clutter 0.75 and 1.0, and 0.65 in their worst two seconds.
Only a share above 0.69 raises the sum."""
CONDEMNED, MAX_SUM = 11.0, 15.0
"""Threshold of the sum (60,000 to 1), and its upper limit. Measured: 10.4 in three flights among 70
posts. Ten times the noise was detected within 50 s in 25 of 27 flights, mostly within 5 s, and at
rest after 0.5 s."""
MEMORY_S = 10.0
"""Time constant of the sum's decay, s. Chosen: a sensor without readings gives no new information;
the time is twice the usual time of a detection."""


class Scatter:
    """Noise test of one sensor."""

    def __init__(self) -> None:
        self._last_m: tuple[float, float] = (math.nan, math.nan)
        """The last two distances, m."""
        self._last_aside_m = 0.0
        self._lately_m: deque[float] = deque(maxlen=KNOWN_OF)
        self._sum = 0.0
        self._seen_s = -math.inf

    @property
    def is_too_much(self) -> bool:
        return self._sum > CONDEMNED

    def pause(self) -> None:
        """Exclude a comparison of the next reading with the last one."""
        self._last_m = (math.nan, math.nan)

    def take(self, time_s: float, reading: RangeReading, aside_m: float) -> None:
        """Add a reading; the beam's end moved aside by `aside_m` since the previous one."""
        self._sum *= math.exp((self._seen_s - time_s) / MEMORY_S)
        self._seen_s = time_s
        before_m, middle_m = self._last_m
        now_m = reading.distance_m if reading.is_distance else math.nan
        moved_m, self._last_aside_m = 0.5 * (self._last_aside_m + aside_m), aside_m
        self._last_m = middle_m, now_m
        off_m = abs(before_m - 2 * middle_m + now_m)
        sigma_m = math.sqrt(reading.variance_m2)
        lately_m = tuple(self._lately_m)
        self._lately_m.append(now_m)
        if len(lately_m) < KNOWN_OF or math.isnan(off_m):
            return
        is_rough = off_m > ROUGH_SIGMAS * sigma_m
        if is_rough:
            known_by = sum(abs(m - now_m) < KNOWN_SIGMAS * sigma_m for m in lately_m)
            is_rough = known_by < KNOWN_BY
        self._sum = min(max(0.0, self._sum + _log_ratio(moved_m, is_rough=is_rough)), MAX_SUM)


def _log_ratio(moved_m: float, *, is_rough: bool) -> float:
    """Log-likelihood ratio of a reading: noisy sensor against sound sensor."""
    share = min(1.0, moved_m / LEG_M)
    sound = ROUGH_AT_REST + share * (ROUGH_IN_CLUTTER - ROUGH_AT_REST)
    return math.log(ROUGH_IF_NOISY / sound if is_rough else (1 - ROUGH_IF_NOISY) / (1 - sound))
