"""Converts an autopilot's time since boot to our clock, if either clock drifts, steps or stops.

A message is never early, and the one with the least latency determines the offset of the clocks.
The two clocks drift slowly. If either clock steps or stops, all messages become late or early by
the same amount.
"""

import math

DRIFT = 50e-6
"""Largest drift between two quartz clocks; the offset rises at this rate, s/s. Chosen."""
WINDOW_S, DRIFTED_S = 2.0, 0.003
"""If the least latency over this window exceeds this, s, the clocks drift faster. Chosen: an RC
oscillator or a simulator's time drifts by 1e-3."""
MAX_EARLIER_S = 0.05
"""Largest decrease of the offset in one tick, s. Chosen: a pause between the read of our clock and
the read of the messages makes messages appear to be from the future."""
PUNCTUAL_S = 0.03
"""The least latency of a few messages is at most this, s. Chosen."""
STEP_AFTER_S = 0.25
"""After this time without a punctual message a clock has stepped or lagged, s. Chosen: radio delay
does not last this long. A simulator's clock on a busy machine lags repeatedly."""
STEP_SPREAD_S = 0.08
"""After a step all latencies lie within this interval, s; with radio delay they vary more.
Chosen."""
MAX_LATENCY_S = 0.2
"""Messages with a larger latency are not usable, for any reason, s. Chosen."""
SET_BACK_S = 0.5
"""An autopilot time this far below the newest one is a reboot or a step, not reordering, s.
Chosen."""


class BootClock:
    """Tracks one autopilot's clock."""

    def __init__(self) -> None:
        self._offset_s = math.inf
        self._lowest_s = math.inf
        """Lower limit of the offset in this tick, s."""
        self._received_s = 0.0
        self._newest_boot_s = -math.inf
        self._window_since_s, self._window_least_s = 0.0, math.inf
        self._off_sign = 0
        """1: all messages are late, -1: all are early, 0: neither."""
        self._off_since_s, self._off_min_s, self._off_max_s = 0.0, math.inf, -math.inf
        """Start of this period, and least and largest offset in it, s."""

    def receive(self, boot_s: float, now_s: float) -> bool:
        """Process the arrival of a message; True if a clock step was detected.

        After a step, stamps may be older than those before.
        """
        offset_s = now_s - boot_s
        was_set_back = boot_s < self._newest_boot_s - SET_BACK_S
        self._newest_boot_s = max(self._newest_boot_s, boot_s)
        if math.isinf(self._offset_s) or was_set_back:
            return self._step_to(offset_s, boot_s, now_s)
        if now_s != self._received_s:
            self._offset_s += DRIFT * (now_s - self._received_s)
            self._follow_drift(now_s)
            self._lowest_s = self._offset_s - MAX_EARLIER_S
            self._received_s = now_s
        self._window_least_s = min(self._window_least_s, offset_s)
        self._offset_s = min(self._offset_s, max(offset_s, self._lowest_s))
        late_s = offset_s - self._offset_s
        off_sign = 0 if abs(late_s) <= PUNCTUAL_S else 1 if late_s > 0 else -1
        if off_sign == 0 or off_sign != self._off_sign:
            self._off_sign, self._off_since_s = off_sign, now_s
            self._off_min_s = self._off_max_s = offset_s
            return False
        self._off_min_s = min(self._off_min_s, offset_s)
        self._off_max_s = max(self._off_max_s, offset_s)
        is_step = self._off_max_s - self._off_min_s <= STEP_SPREAD_S
        is_unusable = abs(self._off_min_s - self._offset_s) > MAX_LATENCY_S
        if now_s - self._off_since_s <= STEP_AFTER_S or not (is_step or is_unusable):
            return False
        return self._step_to(self._off_min_s, boot_s, now_s)

    def _step_to(self, offset_s: float, boot_s: float, now_s: float) -> bool:
        self._offset_s, self._newest_boot_s = offset_s, boot_s
        self._lowest_s, self._received_s = offset_s - MAX_EARLIER_S, now_s
        self._window_since_s, self._window_least_s = now_s, offset_s
        self._off_sign = 0
        return True

    def _follow_drift(self, now_s: float) -> None:
        """Raise the offset to the least one of the window if no message has reached it."""
        if now_s - self._window_since_s > WINDOW_S:
            if self._window_least_s > self._offset_s + DRIFTED_S:
                self._offset_s = self._window_least_s
            self._window_since_s, self._window_least_s = now_s, math.inf

    def time_s(self, boot_s: float) -> float:
        """The same moment by our clock."""
        return boot_s + self._offset_s
