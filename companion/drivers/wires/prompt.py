"""Limits the time that wires may block; a late answer is a fault.

On an I2C bus whose SDA or SCL is held low the kernel aborts a transfer only after a second. A
serial adapter or an SPI device may hang as well. So each wire has a line, a thread of its own that
executes one request at a time. The caller waits for at most `REQUEST_TIMEOUT_S`. Then it gets a
TimeoutError, and a later answer is discarded.

    open ──no answer in time, or ETIMEDOUT──► shut ──line free again and PROBE_S over──► open

A shut wire fails at once. All wires together take at most `SHARE` of the control loop's time, and
at most `MAX_AT_ONCE_S` at once.
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

REQUEST_TIMEOUT_S = 0.03
"""Timeout of one request, s. Chosen: the longest, a full FIFO of the gyro at 100 kHz, takes 18
ms."""
PROBE_S = 0.1
"""A wire stays shut for this time, s. Chosen: short enough that a wire which recovers is not
FAILED."""
MAX_AT_ONCE_S, SHARE = 0.1, 0.8
"""Limits of the time of all wires: at once, s, and share of the control loop's time. Chosen: the
longest first tick, five VL53L1X to configure at 100 kHz, takes 75 ms; later 20 ms of 50."""
OPEN_TIMEOUT_S = 3.0
"""Timeout of a wire's first request, s, before take-off: it loads libraries and opens the wire.
Chosen."""
I2C = "the I2C bus"
"""Name of the I2C bus in messages."""
Answer = TypeVar("Answer")


class Line(Protocol):
    """Executes one request at a time."""

    @property
    def is_busy(self) -> bool:
        """True while a request that has timed out is still running."""
        ...

    def ask(self, request: Callable[[], Answer], within_s: float) -> Answer:
        """Result of the request, or its exception.

        Raises:
            TimeoutError: it takes longer than `within_s`.
        """
        ...

    def close(self) -> None: ...


class Worker:
    """A line with its own thread, which does not block the program's exit."""

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
            except Exception as error:  # raised again in the caller
                self._answers.put((None, error))


@dataclass(slots=True)
class _Wire:
    line: Line
    is_opened: bool = False
    shut_until_s: float = -math.inf


class PromptWires:
    """Puts each of `wires` behind a line; `now_s` is the clock of the timeouts."""

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
        self._budget_s = MAX_AT_ONCE_S
        """Remaining time budget from the control loop, s."""
        self._done_s = now_s()

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        return self._request(I2C, lambda: self._wires.transfer(transactions))

    def exchange(self, device: str, data: bytes) -> bytes:
        return self._request(device, lambda: self._wires.exchange(device, data))

    def receive(self, port: str, baud: int) -> bytes:
        return self._request(port, lambda: self._wires.receive(port, baud))

    def _request(self, name: str, request: Callable[[], Answer]) -> Answer:
        wire = self._by_name.get(name)
        if wire is None:
            wire = self._by_name[name] = _Wire(self._make_line())
        now_s = self._now_s()
        earned_s = (now_s - self._done_s) * SHARE / (1 - SHARE)
        self._budget_s = min(self._budget_s + earned_s, MAX_AT_ONCE_S)
        self._done_s = now_s
        if self._budget_s <= 0 or now_s < wire.shut_until_s or wire.line.is_busy:
            raise TimeoutError(errno.ETIMEDOUT, f"{name} does not answer in time")
        try:
            return self._wait(wire, request)
        except TimeoutError:
            wire.shut_until_s = self._now_s() + PROBE_S
            raise

    def _wait(self, wire: _Wire, request: Callable[[], Answer]) -> Answer:
        if not wire.is_opened:
            answer = wire.line.ask(request, OPEN_TIMEOUT_S)
            wire.is_opened = True
            return answer
        began_s = self._done_s
        try:
            return wire.line.ask(request, min(REQUEST_TIMEOUT_S, self._budget_s))
        finally:
            self._done_s = self._now_s()
            self._budget_s -= self._done_s - began_s

    def close(self) -> None:
        for wire in self._by_name.values():
            wire.line.close()
        self._wires.close()
