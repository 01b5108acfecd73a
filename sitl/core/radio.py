"""Simulates an unreliable radio link: loss, duplicates, delay, reordering."""

import heapq
from collections.abc import Iterable
from dataclasses import dataclass
from random import Random
from typing import Generic, TypeVar

M = TypeVar("M")
"""A message of any kind."""
OUT_OF_ORDER_S = 0.06
"""Extra delay of a message that is overtaken by later ones, s. Chosen."""


@dataclass(frozen=True, slots=True)
class LinkErrors:
    """Shares of all messages, 0 to 1, and the largest random delay, s."""

    loss: float = 0.0
    duplicates: float = 0.0
    reordering: float = 0.0
    jitter_s: float = 0.0


NO_LINK_ERRORS = LinkErrors()
"""A perfect link."""


class Radio(Generic[M]):
    """One direction of a link."""

    def __init__(self, random: Random) -> None:
        self.errors = NO_LINK_ERRORS
        self._random = random
        self._under_way: list[tuple[float, int, M]] = []
        self._count = 0

    def carry(self, messages: Iterable[M], now_s: float) -> Iterable[M]:
        """Accept messages to send; return those that arrive by `now_s`."""
        if self.errors is NO_LINK_ERRORS and not self._under_way:
            return messages
        self.launch(messages, now_s)
        return self.arrived(now_s)

    def launch(self, messages: Iterable[M], now_s: float) -> None:
        """Accept messages to send."""
        for message in messages:
            self._launch(message, now_s)

    def arrived(self, now_s: float) -> list[M]:
        """Messages that arrive by `now_s`."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now_s:
            arrived.append(heapq.heappop(self._under_way)[2])
        return arrived

    def _launch(self, message: M, now_s: float) -> None:
        random, errors = self._random, self.errors
        if random.random() < errors.loss:
            return
        for _ in range(2 if random.random() < errors.duplicates else 1):
            late_s = random.uniform(0.0, errors.jitter_s)
            if random.random() < errors.reordering:
                late_s += OUT_OF_ORDER_S
            self._count += 1
            heapq.heappush(self._under_way, (now_s + late_s, self._count, message))
