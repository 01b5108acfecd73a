"""From an autopilot's time since boot to ours, whatever becomes of either clock.

A message is never early, and the quickest had the shortest way: from it is seen how far the
autopilot's time lies behind ours. The two clocks run apart slowly, and either may be set or stand
still: then all messages are late, or early, and keep being so.
"""

import math

DRIFT = 50e-6
"""Two quartzes part by no more, s/s; the offset is let go at this rate."""
WINDOW_S, APART_S = 2.0, 0.003
"""When the quickest message of so long was later by more than this, they run apart faster, as an RC
oscillator or the time of a simulator does, by 1e-3."""
MAX_EARLIER_S = 0.05
"""The offset falls by no more in one tick: if we are paused between looking at our clock and
reading what has come, messages seem to be from the future."""
IN_TIME_S = 0.03
"""The quickest message of a few is as late as this at most."""
SET_S = 0.25
"""When no message has been in time for so long, it is not the radio: a clock was set, or has
lagged, as that of a simulator on a busy machine does again and again."""
ALIKE_S = 0.08
"""A clock that was set makes all messages late alike, as they are of different age when they are
read, a radio each by another time."""
USELESS_S = 0.2
"""Later than that they are of no use, whatever the reason."""
SET_BACK_S = 0.5
"""No message is overtaken by one that is so much younger."""


class BootClock:
    """Follows one autopilot's clock."""

    def __init__(self) -> None:
        self._offset_s = math.inf
        self._lowest_s = math.inf
        """How far the offset may fall in this tick."""
        self._heard_s = 0.0
        self._newest_boot_s = -math.inf
        self._window_since_s, self._window_least_s = 0.0, math.inf
        self._out = 0
        """Messages keep being late (1) or early (-1)"""
        self._out_since_s, self._out_least_s, self._out_most_s = 0.0, math.inf, -math.inf
        """since then, and by so much at least and at most."""

    def hear(self, boot_s: float, now_s: float) -> bool:
        """Note when a message came; True if its clock was set: no stamp is newer than another."""
        offset_s = now_s - boot_s
        was_set_back = boot_s < self._newest_boot_s - SET_BACK_S
        self._newest_boot_s = max(self._newest_boot_s, boot_s)
        if math.isinf(self._offset_s) or was_set_back:
            return self._set(offset_s, boot_s, now_s)
        if now_s != self._heard_s:
            self._offset_s += DRIFT * (now_s - self._heard_s)
            self._slide(now_s)
            self._lowest_s = self._offset_s - MAX_EARLIER_S
            self._heard_s = now_s
        self._window_least_s = min(self._window_least_s, offset_s)
        self._offset_s = min(self._offset_s, max(offset_s, self._lowest_s))
        late_s = offset_s - self._offset_s
        out = 0 if abs(late_s) <= IN_TIME_S else 1 if late_s > 0 else -1
        if out == 0 or out != self._out:
            self._out, self._out_since_s = out, now_s
            self._out_least_s = self._out_most_s = offset_s
            return False
        self._out_least_s = min(self._out_least_s, offset_s)
        self._out_most_s = max(self._out_most_s, offset_s)
        are_alike = self._out_most_s - self._out_least_s <= ALIKE_S
        are_useless = abs(self._out_least_s - self._offset_s) > USELESS_S
        if now_s - self._out_since_s <= SET_S or not (are_alike or are_useless):
            return False
        return self._set(self._out_least_s, boot_s, now_s)

    def _set(self, offset_s: float, boot_s: float, now_s: float) -> bool:
        self._offset_s, self._newest_boot_s = offset_s, boot_s
        self._lowest_s, self._heard_s = offset_s - MAX_EARLIER_S, now_s
        self._window_since_s, self._window_least_s = now_s, offset_s
        self._out = 0
        return True

    def _slide(self, now_s: float) -> None:
        """The quickest message of a while is the measure when there was none quicker."""
        if now_s - self._window_since_s > WINDOW_S:
            if self._window_least_s > self._offset_s + APART_S:
                self._offset_s = self._window_least_s
            self._window_since_s, self._window_least_s = now_s, math.inf

    def time_s(self, boot_s: float) -> float:
        """The same moment by our clock."""
        return boot_s + self._offset_s
