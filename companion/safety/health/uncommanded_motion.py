"""Detects a fly-away: a velocity that no response to the setpoints explains.

    possible responses, in the direction of the velocity
    ├──────────────────────►│◄── unasked ──►│ velocity

The response time of the autopilot is unknown. So every velocity between zero, the response of a
very quick autopilot and that of a very slow one is normal. A gust pushes the drone to a constant
velocity. In a fly-away the velocity keeps growing.
"""

import math
from collections import deque
from itertools import pairwise

from companion.core.frames import Vector3, frd_to_ned
from companion.core.messages import Odometry, Setpoint

QUICKEST_S, SLOWEST_S = 0.2, 2.0
"""Time constants of the quickest and the slowest response, s. Measured: PX4 flew at 0.18 m/s 2 s
after a stop from 0.5 m/s; no autopilot responds quicker than the first."""
DEAD_S = 0.5
"""Maximum dead time of the quick response, s; ArduCopter begins to move after 0.25 s."""
SETTLED_S = 1.0
"""Time without a check after setpoints begin, s. Chosen: a take-off may end at 1.2 m/s."""
GAP_S = 0.5
"""Setpoints farther apart than this are no stream, s. Chosen."""
FAR_M_S = 1.5
"""Excess velocity that is a fly-away even if it does not grow, m/s. Chosen: more than any gust
indoors, and half of the velocity for which the walls leave time."""
PUSHED_M_S = 1.1
"""Excess velocity that is a fly-away if it grows, m/s. Chosen: more than a gust of 1 m/s with an
overshoot of a tenth."""
NEAR_M_S = 0.5
"""Below this excess velocity there is no fly-away, and a detected one ends, m/s. Chosen."""
QUICK_S, QUICK_M_S = 0.2, 0.25
"""Quick growth: a window, s, and the least increase in it, m/s. Chosen."""
THIRDS_S = (1.0, 0.67, 0.33, 0.0)
"""Ages of the samples at the ends of the thirds of the last second, s."""
STEADY_M_S = 0.12
"""Steady growth: the least increase in each third of the last second, m/s. Chosen: a gust rises
within one or two of them."""

STILL: Vector3 = (0.0, 0.0, 0.0)
"""Velocity at rest, m/s."""


class UncommandedMotionWatch:
    """Fly-away detector of one drone; time is an argument."""

    def __init__(self) -> None:
        self.uncommanded_m_s = 0.0
        """Excess velocity: the part that no response to the setpoints explains, m/s."""
        self.has_flown_away = False
        self._quick: deque[tuple[float, Vector3]] = deque()
        self._slow = STILL
        self._since_s = math.inf
        self._noted: deque[tuple[float, float]] = deque()
        """Times, s, and the excess velocities at these times, m/s."""

    def ask(self, now_s: float, setpoint: Setpoint | None, yaw_rad: float) -> None:
        """Record the setpoint of this tick; None if the autopilot flies without one."""
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
        """Compare the velocity in the autopilot's odometry with the possible responses."""
        now_s = odometry.time_s
        if not self._quick or now_s - self._since_s < SETTLED_S:
            self._noted.clear()
            self.uncommanded_m_s, self.has_flown_away = 0.0, False
            return
        self.uncommanded_m_s = self._beyond(odometry.velocity_ned_m_s)
        self._noted.append((now_s, self.uncommanded_m_s))
        while now_s - self._noted[0][0] > THIRDS_S[0] + GAP_S:
            self._noted.popleft()
        if self.uncommanded_m_s < NEAR_M_S:
            self.has_flown_away = False
        elif self._is_far(now_s) or self._grows_steadily(now_s):
            self.has_flown_away = True

    def _is_far(self, now_s: float) -> bool:
        if self.uncommanded_m_s > FAR_M_S:
            return True
        before = self._at(now_s - QUICK_S)
        grows = before is not None and self.uncommanded_m_s - before >= QUICK_M_S
        return grows and self.uncommanded_m_s > PUSHED_M_S

    def _grows_steadily(self, now_s: float) -> bool:
        steps = [self._at(now_s - ago_s) for ago_s in THIRDS_S]
        return all(
            one is not None and other is not None and other - one >= STEADY_M_S
            for one, other in pairwise(steps)
        )

    def _beyond(self, velocity_ned_m_s: Vector3) -> float:
        """Excess of the velocity over all possible responses, in its own direction, m/s."""
        speed = math.hypot(*velocity_ned_m_s)
        if speed == 0.0:
            return 0.0
        course = [v / speed for v in velocity_ned_m_s]
        answers = (self._slow, *(quick for _, quick in self._quick))
        asked = max(sum(a * c for a, c in zip(v, course, strict=True)) for v in answers)
        return max(0.0, speed - max(0.0, asked))

    def _at(self, time_s: float) -> float | None:
        """Last excess velocity noted until `time_s`, m/s; None if there is none."""
        return next(
            (m_s for noted_s, m_s in reversed(self._noted) if noted_s <= time_s + 1e-6), None
        )


def _answer(was: Vector3, asked: Vector3, share: float) -> Vector3:
    """First-order response to `asked` after `share` time constants, m/s."""
    gain = 1 - math.exp(-share)
    north, east, down = (w + gain * (a - w) for w, a in zip(was, asked, strict=True))
    return north, east, down
