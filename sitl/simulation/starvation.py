"""A companion's computer that has no time for it: ticks come late, or reads within a tick do."""

from random import Random


class Starvation:
    """A fault for tests; how late is drawn for each tick, or each read, of those that are."""

    READ_SHARE = 0.2
    """Of the times that are asked for within a tick: some three, so that it stands still in half of
    all ticks."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._late_s: tuple[float, float] | None = None
        self._between_reads = False

    def begin(self, least_s: float, most_s: float, *, between_reads: bool) -> None:
        """From now on late by a time between these."""
        self._late_s, self._between_reads = (least_s, most_s), between_reads

    def end(self) -> None:
        self._late_s = None

    def tick_late_s(self) -> float:
        """By how much the next tick is."""
        return self._draw() if not self._between_reads else 0.0

    def read_late_s(self) -> float:
        """How long it stands still before the next read."""
        pauses = self._between_reads and self._random.random() < self.READ_SHARE
        return self._draw() if pauses else 0.0

    def _draw(self) -> float:
        return self._random.uniform(*self._late_s) if self._late_s else 0.0
