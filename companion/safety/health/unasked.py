"""A velocity that nobody asked for: an autopilot that flies away, before it has come far.

    what may be the answer, in the direction of the velocity
    ├──────────────────────►│◄── unasked ──►│ velocity

How quickly an autopilot answers is not known, so that everything is as asked between standing
still, the answer of one that is quicker than any, and of one that is slower. Gusts push a drone to
a velocity, and it stays there; an autopilot that flies away goes faster and faster.
"""

import math
from collections import deque
from itertools import pairwise

from companion.core.frames import Vector3, frd_to_ned
from companion.core.messages import Odometry, Setpoint

QUICKEST_S, SLOWEST_S = 0.2, 2.0
"""Time constants: nothing answers sooner, and of 0.5 m/s PX4 still flew 0.18 2 s after a stop."""
DEAD_S = 0.5
"""The quick answer may come so much later: ArduCopter begins to move after 0.25 s."""
SETTLED_S = 1.0
"""After setpoints begin, such as at the end of a take-off of 1.2 m/s."""
GAP_S = 0.5
"""Farther apart, setpoints are no stream."""
FAR_M_S = 1.5
"""Unasked, growing or not: more than any gust indoors, and half of what walls leave time for."""
PUSHED_M_S = 1.1
"""More than a gust of 1 m/s and an overshoot of a tenth come to: it must not grow any more."""
NEAR_M_S = 0.5
"""Less is borne, growing or not; what has been noticed lasts until it is less."""
QUICK_S, QUICK_M_S = 0.2, 0.25
"""Growing: by so much in so long."""
THIRDS_S = (1.0, 0.67, 0.33, 0.0)
STEADY_M_S = 0.12
"""Growing steadily: by so much in each third of the last second. A gust rises within one or two."""

STILL: Vector3 = (0.0, 0.0, 0.0)


class UnaskedWatch:
    """Of one drone; time is an argument."""

    def __init__(self) -> None:
        self.unasked_m_s = 0.0
        """By how much it is faster than it was asked to be."""
        self.has_flown_away = False
        self._quick: deque[tuple[float, Vector3]] = deque()
        self._slow = STILL
        self._since_s = math.inf
        self._noted: deque[tuple[float, float]] = deque()
        """Times and what was unasked then."""

    def ask(self, now_s: float, setpoint: Setpoint | None, yaw_rad: float) -> None:
        """What goes out at this tick; None: nothing, the autopilot flies as it sees fit."""
        if setpoint is None:
            self._quick.clear()
            return
        if not self._quick or now_s - self._quick[-1][0] > GAP_S:
            self._since_s, self._slow = now_s, STILL
            self._quick = deque([(now_s, STILL)])
        north, east = frd_to_ned(setpoint.forward_m_s, setpoint.right_m_s, yaw_rad)
        asked = north, east, setpoint.down_m_s
        last_s, quick = self._quick[-1]
        dt_s = now_s - last_s
        self._quick.append((now_s, _answer(quick, asked, dt_s / QUICKEST_S)))
        self._slow = _answer(self._slow, asked, dt_s / SLOWEST_S)
        while now_s - self._quick[0][0] > DEAD_S:
            self._quick.popleft()

    def take(self, odometry: Odometry) -> None:
        """What the autopilot tells of its velocity."""
        now_s = odometry.time_s
        if not self._quick or now_s - self._since_s < SETTLED_S:
            self._noted.clear()
            self.unasked_m_s, self.has_flown_away = 0.0, False
            return
        self.unasked_m_s = self._beyond(odometry.velocity_ned_m_s)
        self._noted.append((now_s, self.unasked_m_s))
        while now_s - self._noted[0][0] > THIRDS_S[0] + GAP_S:
            self._noted.popleft()
        if self.unasked_m_s < NEAR_M_S:
            self.has_flown_away = False
        elif self._is_far(now_s) or self._grows_steadily(now_s):
            self.has_flown_away = True

    def _is_far(self, now_s: float) -> bool:
        if self.unasked_m_s > FAR_M_S:
            return True
        before = self._at(now_s - QUICK_S)
        grows = before is not None and self.unasked_m_s - before >= QUICK_M_S
        return grows and self.unasked_m_s > PUSHED_M_S

    def _grows_steadily(self, now_s: float) -> bool:
        steps = [self._at(now_s - ago_s) for ago_s in THIRDS_S]
        return all(
            one is not None and other is not None and other - one >= STEADY_M_S
            for one, other in pairwise(steps)
        )

    def _beyond(self, velocity_ned_m_s: Vector3) -> float:
        """How far the velocity reaches beyond all answers, in its own direction."""
        speed = math.hypot(*velocity_ned_m_s)
        if speed == 0.0:
            return 0.0
        course = [v / speed for v in velocity_ned_m_s]
        answers = (self._slow, *(quick for _, quick in self._quick))
        asked = max(sum(a * c for a, c in zip(v, course, strict=True)) for v in answers)
        return max(0.0, speed - max(0.0, asked))

    def _at(self, time_s: float) -> float | None:
        """What was told last by then."""
        return next(
            (m_s for noted_s, m_s in reversed(self._noted) if noted_s <= time_s + 1e-6), None
        )


def _answer(was: Vector3, asked: Vector3, share: float) -> Vector3:
    """On by a share of the time constant."""
    gain = 1 - math.exp(-share)
    north, east, down = (w + gain * (a - w) for w, a in zip(was, asked, strict=True))
    return north, east, down
