"""Assigns times to the samples of a chip with its own clock and a FIFO."""

MIN_PERIOD_SAMPLES = 119
"""Least samples, one second, from which their number determines the period. Chosen."""


class SampleClock:
    """Times of a chip's samples by our clock.

    The chip's period is known to some percent, and its start is unknown. The newest sample in the
    FIFO is never in the future nor older than a period. So each read narrows the times of the
    samples, and the number of all samples determines the period.
    """

    def __init__(self, time_s: float, nominal_hz: float) -> None:
        self._began_s = self.newest_s = time_s
        self._period_s = 1 / nominal_hz
        self._count = 0

    def stamp(self, time_s: float, count: int) -> list[float]:
        """Times of the `count` samples that are in the FIFO at `time_s`."""
        self._count += count
        if self._count >= MIN_PERIOD_SAMPLES:
            self._period_s = (time_s - self._began_s) / self._count
        newest_s = self.newest_s + count * self._period_s
        newest_s = min(max(newest_s, time_s - self._period_s), time_s)
        step_s = (newest_s - self.newest_s) / count
        times_s = [self.newest_s + i * step_s for i in range(1, count + 1)]
        self.newest_s = newest_s
        return times_s
