"""Many flights at once, each lane a process; a process that dies loses only its own flight.

Ctrl-C lets the flights that are under way end, and gives what has been flown by then.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import (
    CancelledError,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
)
from concurrent.futures.process import BrokenProcessPool
from itertools import count
from queue import SimpleQueue
from typing import Generic, TypeVar

from rich.console import Console
from rich.progress import Progress

from sitl.bench.missions import Flown, Job, fly, lost

J = TypeVar("J")
F = TypeVar("F")


def fly_all(
    jobs: Sequence[J],
    tell: Callable[[F], None],
    fly_one: Callable[[J], F],
    lose_one: Callable[[J, str], F],
) -> list[F]:
    """All flights in the order of the jobs; `tell` hears of each as it ends.

    `lose_one` makes the row of a job whose process has died.
    """
    number = min(cores(), len(jobs))
    lanes: SimpleQueue[_Lane[J, F]] = SimpleQueue()
    for _ in range(number):
        lanes.put(_Lane(fly_one, lose_one))

    def on_a_lane(job: J) -> F:
        lane = lanes.get()
        try:
            return lane.fly(job)
        finally:
            lanes.put(lane)

    with ThreadPoolExecutor(max(number, 1)) as crew:
        flights = [crew.submit(on_a_lane, job) for job in jobs]
        try:
            for flight in as_completed(flights):
                tell(flight.result())
        except KeyboardInterrupt:
            crew.shutdown(cancel_futures=True)
    for _ in range(number):
        lanes.get().close()
    return [flown for flight in flights for flown in _results(flight)]


def _results(flight: Future[F]) -> list[F]:
    """One, or none of a flight that was called off."""
    try:
        return [flight.result()]
    except CancelledError:
        return []


def fly_and_show(
    jobs: Sequence[Job], keep: Callable[[Flown], None] = lambda _: None
) -> list[Flown]:
    """Missions with a bar on stderr, where it is not in the way of what is printed.

    `keep` is given each flight as it ends: a campaign may take hours.
    """

    def told(flown: Flown) -> str:
        keep(flown)
        row = flown.row
        verdict = "completed" if row["completed"] else f"not completed: {row['ending']}"
        return f"{row['world']} {verdict}"

    return with_a_bar(jobs, told, fly, lost)


def with_a_bar(
    jobs: Sequence[J],
    told: Callable[[F], str],
    fly_one: Callable[[J], F],
    lose_one: Callable[[J, str], F],
) -> list[F]:
    """The same with a bar that says of each flight what `told` makes of it; in a log, lines."""
    console = Console(stderr=True, highlight=False)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task("flying", total=len(jobs))
        done = count(1)

        def tell(flown: F) -> None:
            if console.is_terminal:
                progress.update(bar, advance=1, description=told(flown))
            else:
                console.print(f"{next(done)} of {len(jobs)}: {told(flown)}")

        return fly_all(jobs, tell, fly_one, lose_one)


def cores() -> int:
    """That this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Lane(Generic[J, F]):
    """A process for one flight after another, and a new one when it has died."""

    def __init__(self, fly_one: Callable[[J], F], lose_one: Callable[[J, str], F]) -> None:
        self._fly_one, self._lose_one = fly_one, lose_one
        self._process = _process()

    def fly(self, job: J) -> F:
        try:
            return self._process.submit(self._fly_one, job).result()
        except BrokenProcessPool:
            self.close()
            self._process = _process()
            return self._lose_one(job, "its process died")

    def close(self) -> None:
        self._process.shutdown()


def _process() -> ProcessPoolExecutor:
    """Spawned: a process with threads must not be forked. Ctrl-C is not for it."""
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(
        1, context, initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_IGN)
    )
