"""Simulates an overloaded companion computer: late ticks, or pauses within a tick."""

from random import Random


class Starvation:
    """A fault for tests; the delay is drawn for each tick, or for some of the reads."""

    READ_SHARE = 0.2
    """Share of delayed reads. With about three reads per tick, half of all ticks have a pause."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._late_s: tuple[float, float] | None = None
        self._between_reads = False

    def begin(self, least_s: float, most_s: float, *, between_reads: bool) -> None:
        """Start to delay by a random time between the limits."""
        self._late_s, self._between_reads = (least_s, most_s), between_reads

    def end(self) -> None:
        self._late_s = None

    def tick_late_s(self) -> float:
        """Delay of the next tick, s."""
        return self._draw() if not self._between_reads else 0.0

    def read_late_s(self) -> float:
        """Pause before the next read, s."""
        pauses = self._between_reads and self._random.random() < self.READ_SHARE
        return self._draw() if pauses else 0.0

    def _draw(self) -> float:
        return self._random.uniform(*self._late_s) if self._late_s else 0.0
