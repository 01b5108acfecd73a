"""Wires that keep nobody waiting: what they do not answer in time is a fault of theirs.

On an I2C bus whose SDA or SCL is held low the kernel gives a transfer up only after a second, and a
serial adapter or an SPI device may hang as well. So each wire has a line, a thread of its own, that
carries out one request at a time. Who asks waits for `PATIENCE_S`; then it is told a TimeoutError,
and the answer, should it ever come, is thrown away.

    open ──no answer in time, or ETIMEDOUT──► shut ──line free again and PROBE_S over──► open

A wire that is shut refuses at once. Whatever the wires do, all of them together take no more than
`SHARE` of the time from the control loop, and no more than `MAX_AT_ONCE_S` at once.
"""

import errno
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, Protocol, TypeVar

from companion.drivers.wires.bus import Transaction, Wires

PATIENCE_S = 0.03
"""Of one request; the longest, a full FIFO of the gyro at 100 kHz, takes 18 ms."""
PROBE_S = 0.1
"""So long a wire stays shut: often enough that one which comes back is not called failed."""
MAX_AT_ONCE_S, SHARE = 0.1, 0.8
"""The longest first tick, five VL53L1X to be set up at 100 kHz, takes 75 ms; then 20 ms of 50."""
OPENING_S = 3.0
"""For a wire's first request, before take-off, in which libraries are loaded and it is opened."""
I2C = "the I2C bus"
Answer = TypeVar("Answer")


class Line(Protocol):
    """Carries out one request at a time."""

    @property
    def is_busy(self) -> bool:
        """It is still with a request that nobody waits for any more."""
        ...

    def ask(self, request: Callable[[], Answer], within_s: float) -> Answer:
        """What the request returns or raises.

        Raises:
            TimeoutError: it takes longer.
        """
        ...

    def close(self) -> None: ...


class Worker:
    """A line that is a thread; it does not keep the program from ending."""

    def __init__(self) -> None:
        self._requests: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()
        self._answers: SimpleQueue[tuple[Any, Exception | None]] = SimpleQueue()
        self._is_late = False
        Thread(target=self._work, daemon=True).start()

    @property
    def is_busy(self) -> bool:
        if self._is_late:
            self._is_late = self._answers.empty()
            if not self._is_late:
                self._answers.get()
        return self._is_late

    def ask(self, request: Callable[[], Answer], within_s: float) -> Answer:
        self._requests.put(request)
        try:
            answer, error = self._answers.get(timeout=within_s)
        except Empty:
            self._is_late = True
            raise TimeoutError(errno.ETIMEDOUT, f"no answer in {within_s:.2g} s") from None
        if error is not None:
            raise error
        return answer  # type: ignore[no-any-return]

    def close(self) -> None:
        self._requests.put(None)

    def _work(self) -> None:
        while (request := self._requests.get()) is not None:
            try:
                self._answers.put((request(), None))
            except Exception as error:  # it is for whoever asked
                self._answers.put((None, error))


@dataclass(slots=True)
class _Wire:
    line: Line
    is_opened: bool = False
    shut_until_s: float = -math.inf


class PromptWires:
    """`wires`, each behind a line; `now_s` is the clock by which they are waited for."""

    def __init__(
        self,
        wires: Wires,
        make_line: Callable[[], Line] = Worker,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._wires = wires
        self._make_line = make_line
        self._now_s = now_s
        self._by_name: dict[str, _Wire] = {}
        self._left_s = MAX_AT_ONCE_S
        """Of the control loop's time."""
        self._done_s = now_s()

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        return self._ask(I2C, lambda: self._wires.transfer(transactions))

    def exchange(self, device: str, data: bytes) -> bytes:
        return self._ask(device, lambda: self._wires.exchange(device, data))

    def receive(self, port: str, baud: int) -> bytes:
        return self._ask(port, lambda: self._wires.receive(port, baud))

    def _ask(self, name: str, request: Callable[[], Answer]) -> Answer:
        wire = self._by_name.get(name)
        if wire is None:
            wire = self._by_name[name] = _Wire(self._make_line())
        now_s = self._now_s()
        earned_s = (now_s - self._done_s) * SHARE / (1 - SHARE)
        self._left_s = min(self._left_s + earned_s, MAX_AT_ONCE_S)
        self._done_s = now_s
        if self._left_s <= 0 or now_s < wire.shut_until_s or wire.line.is_busy:
            raise TimeoutError(errno.ETIMEDOUT, f"{name} does not answer in time")
        try:
            return self._wait(wire, request)
        except TimeoutError:
            wire.shut_until_s = self._now_s() + PROBE_S
            raise

    def _wait(self, wire: _Wire, request: Callable[[], Answer]) -> Answer:
        if not wire.is_opened:
            answer = wire.line.ask(request, OPENING_S)
            wire.is_opened = True
            return answer
        asked_s = self._done_s
        try:
            return wire.line.ask(request, min(PATIENCE_S, self._left_s))
        finally:
            self._done_s = self._now_s()
            self._left_s -= self._done_s - asked_s

    def close(self) -> None:
        for wire in self._by_name.values():
            wire.line.close()
        self._wires.close()
