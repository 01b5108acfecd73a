"""Readings without a distance, and the lifetime of the latest reading."""

from companion.core.messages import RangeReading, RangeState

NOTHING = RangeReading(RangeState.NOTHING)
TOO_NEAR = RangeReading(RangeState.TOO_NEAR)
FAILED = RangeReading(RangeState.FAILED)

FRESH_S = 0.1
"""A reading is fresh for this time, s. Chosen: a sensor with its own clock may skip a sweep."""


class Latest:
    """The latest reading of one sensor while it is fresh."""

    def __init__(self, fresh_s: float = FRESH_S) -> None:
        self._fresh_s = fresh_s
        self._reading: RangeReading | None = None
        self.time_s = float("-inf")

    def note(self, time_s: float, reading: RangeReading | None) -> None:
        """Store a reading with its time; None is ignored."""
        if reading is not None:
            self.time_s, self._reading = time_s, reading

    def at(self, time_s: float) -> RangeReading | None:
        """The reading that is fresh at a time; None if the sensor is silent."""
        return self._reading if time_s - self.time_s <= self._fresh_s else None
