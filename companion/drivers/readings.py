"""Readings without a distance, and how long the latest one counts."""

from companion.core.messages import RangeReading, RangeState

NOTHING = RangeReading(RangeState.NOTHING)
TOO_NEAR = RangeReading(RangeState.TOO_NEAR)
FAILED = RangeReading(RangeState.FAILED)

FRESH_S = 0.1
"""A sensor with a clock of its own may not have measured again since the last sweep."""


class Latest:
    """The latest reading of one sensor, for as long as it is fresh."""

    def __init__(self, fresh_s: float = FRESH_S) -> None:
        self._fresh_s = fresh_s
        self._reading: RangeReading | None = None
        self.time_s = float("-inf")

    def note(self, time_s: float, reading: RangeReading | None) -> None:
        """Take in what was read at a time; None: nothing new."""
        if reading is not None:
            self.time_s, self._reading = time_s, reading

    def at(self, time_s: float) -> RangeReading | None:
        """What counts at a time; None: it is silent."""
        return self._reading if time_s - self.time_s <= self._fresh_s else None
