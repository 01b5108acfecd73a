"""When a chip with a clock and a FIFO of its own took its samples."""

MIN_TO_TELL_PERIOD = 119
"""Samples, a second of them, from which their number tells the period."""


class SampleClock:
    """When the chip took its samples, by our clock.

    The chip's period is known to some percent, and when it began is not known at all. But the
    newest sample in the FIFO is never in the future nor older than a period: each read narrows
    down where the samples lie, and the number of all samples tells the period.
    """

    def __init__(self, time_s: float, nominal_hz: float) -> None:
        self._began_s = self.newest_s = time_s
        self._period_s = 1 / nominal_hz
        self._count = 0

    def stamp(self, time_s: float, count: int) -> list[float]:
        """The times of the `count` samples that were waiting at `time_s`."""
        self._count += count
        if self._count >= MIN_TO_TELL_PERIOD:
            self._period_s = (time_s - self._began_s) / self._count
        newest_s = self.newest_s + count * self._period_s
        newest_s = min(max(newest_s, time_s - self._period_s), time_s)
        step_s = (newest_s - self.newest_s) / count
        times_s = [self.newest_s + i * step_s for i in range(1, count + 1)]
        self.newest_s = newest_s
        return times_s
