"""Subscriptions of a script to what the flight measures and decides.

    for pose in drone.telemetry.pose():
        print(pose.north_m, pose.east_m)

The control loop never waits for a reader: values wait in a queue of limited length, in which a new
one replaces the oldest.
"""

import asyncio
import threading
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import suppress
from typing import Any, Generic, Self, TypeVar
from weakref import WeakSet

from companion.core.messages import Pose, RangeScan, WallSegment
from companion.ticks import Inputs, Outputs, Progress

T = TypeVar("T")
Read = Callable[[Inputs, Outputs], T | None]
"""Reads the value of a tick; None if there is none."""
QUEUE = 100
"""Values that wait for a reader at most: five seconds of poses. Chosen."""


class Subscription(Generic[T]):
    """Values in their order, with `for` or `async for`; it ends with the flight or at `close`."""

    def __init__(self, read: Read[T], *, on_change: bool = False) -> None:
        self._read, self._on_change = read, on_change
        self._last: T | None = None
        self._values: deque[T] = deque(maxlen=QUEUE)
        self._changed = threading.Condition()
        self._wakers: list[Callable[[], None]] = []
        self._is_closed = False
        self.dropped = 0
        """Number of values that newer ones have replaced before they were read."""

    def publish(self, inputs: Inputs, outputs: Outputs) -> None:
        """Take the value of a tick; the control loop calls it."""
        value = self._read(inputs, outputs)
        if value is None or (self._on_change and value == self._last):
            return
        self._last = value
        with self._changed:
            if self._is_closed:
                return
            self.dropped += len(self._values) == QUEUE
            self._values.append(value)
            self._wake()

    def close(self) -> None:
        """End the subscription; the iteration ends after the values that wait."""
        with self._changed:
            self._is_closed = True
            self._wake()

    def _wake(self) -> None:
        self._changed.notify_all()
        while self._wakers:
            self._wakers.pop()()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[T]:
        return self

    def __next__(self) -> T:
        with self._changed:
            self._changed.wait_for(lambda: self._values or self._is_closed)
            if not self._values:
                raise StopIteration
            return self._values.popleft()

    def __aiter__(self) -> AsyncIterator[T]:
        return self

    async def __anext__(self) -> T:
        while True:
            woken = asyncio.Event()
            with self._changed:
                if self._values:
                    return self._values.popleft()
                if self._is_closed:
                    raise StopAsyncIteration
                self._wakers.append(_waker(woken))
            await woken.wait()


def _waker(woken: asyncio.Event) -> Callable[[], None]:
    """A function that sets an event from another thread."""
    loop = asyncio.get_running_loop()

    def wake() -> None:
        with suppress(RuntimeError):  # the loop is closed, so nobody waits
            loop.call_soon_threadsafe(woken.set)

    return wake


class Subscriptions:
    """What a script can subscribe to.

    Each method returns a subscription, to be read with `for` or, in asyncio, `async for`. With a
    `callback`, a thread calls it with each value instead; an exception in it ends the subscription.
    At most 100 values wait; newer ones replace the oldest, and `dropped` counts them.
    """

    def __init__(self) -> None:
        self._subscriptions: WeakSet[Subscription[Any]] = WeakSet()
        self._subscribing = threading.Lock()
        self._is_closed = False

    def pose(self, callback: Callable[[Pose], None] | None = None) -> Subscription[Pose]:
        """Estimated pose, local NED, 20 times a second, from the end of the gyro's rest on."""
        return self._add(Subscription(lambda _, outputs: outputs.pose), callback)

    def readings(
        self, callback: Callable[[RangeScan], None] | None = None
    ) -> Subscription[RangeScan]:
        """Validated range readings of all beams, 20 times a second."""
        return self._add(Subscription(lambda _, outputs: outputs.scan), callback)

    def battery(self, callback: Callable[[float], None] | None = None) -> Subscription[float]:
        """Remaining share of the battery, 0 to 1: now, and whenever it changes."""
        return self._add(
            Subscription(lambda inputs, _: inputs.telemetry.vehicle.battery, on_change=True),
            callback,
        )

    def activity(self, callback: Callable[[str], None] | None = None) -> Subscription[str]:
        """Activity as text: now, and whenever it changes; at the end, how the flight ended."""
        return self._add(Subscription(_activity, on_change=True), callback)

    def walls(
        self, callback: Callable[[tuple[WallSegment, ...]], None] | None = None
    ) -> Subscription[tuple[WallSegment, ...]]:
        """Walls of the map so far, once a second."""
        return self._add(Subscription(_Walls()), callback)

    def _add(
        self, subscription: Subscription[T], callback: Callable[[T], None] | None
    ) -> Subscription[T]:
        with self._subscribing:
            self._subscriptions.add(subscription)
            if self._is_closed:
                subscription.close()
        if callback is not None:
            arguments = subscription, callback
            threading.Thread(target=_call, args=arguments, name="telemetry", daemon=True).start()
        return subscription

    def publish(self, inputs: Inputs, outputs: Outputs) -> None:
        """Give the values of a tick to all subscriptions; the control loop calls it."""
        for subscription in self._all():
            subscription.publish(inputs, outputs)

    def close(self) -> None:
        """End all subscriptions, with the flight."""
        with self._subscribing:
            self._is_closed = True
        for subscription in self._all():
            subscription.close()

    def _all(self) -> tuple[Subscription[Any], ...]:
        with self._subscribing:
            return tuple(self._subscriptions)


class _Walls:
    """Reads the walls of each progress report, which the loop makes once a second."""

    def __init__(self) -> None:
        self._progress: Progress | None = None

    def __call__(self, inputs: Inputs, outputs: Outputs) -> tuple[WallSegment, ...] | None:
        if outputs.progress is self._progress:
            return None
        self._progress = outputs.progress
        return self._progress.map_walls()


def _activity(inputs: Inputs, outputs: Outputs) -> str:
    return outputs.flight.ending if outputs.finished else outputs.flight.activity


def _call(subscription: Subscription[T], callback: Callable[[T], None]) -> None:
    with subscription:
        for value in subscription:
            callback(value)
