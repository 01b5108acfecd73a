"""Flies many flights in parallel. Each worker is a process; if it dies, only its flight is lost.

After Ctrl-C the running flights end, and the results so far are returned.
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

J = TypeVar("J")
F = TypeVar("F")


def attempted(job: J, fly_one: Callable[[J], F], lose_one: Callable[[J, str], F]) -> F:
    """The result of a job; an exception becomes one by `lose_one`, and the campaign goes on."""
    try:
        return fly_one(job)
    except Exception as error:
        return lose_one(job, f"{type(error).__name__}: {error}")


def fly_all(
    jobs: Sequence[J],
    on_result: Callable[[F], None],
    fly_one: Callable[[J], F],
    lose_one: Callable[[J, str], F],
) -> list[F]:
    """Fly all jobs; return the results in their order. `on_result` is called after each flight.

    `lose_one` makes the result of a job whose process has died.
    """
    number = min(cores(), len(jobs))
    workers: SimpleQueue[_Worker[J, F]] = SimpleQueue()
    for _ in range(number):
        workers.put(_Worker(fly_one, lose_one))

    def on_a_worker(job: J) -> F:
        worker = workers.get()
        try:
            return worker.fly(job)
        finally:
            workers.put(worker)

    with ThreadPoolExecutor(max(number, 1)) as threads:
        flights = [threads.submit(on_a_worker, job) for job in jobs]
        try:
            for flight in as_completed(flights):
                on_result(flight.result())
        except KeyboardInterrupt:
            threads.shutdown(cancel_futures=True)
    for _ in range(number):
        workers.get().close()
    return [flown for flight in flights for flown in _results(flight)]


def _results(flight: Future[F]) -> list[F]:
    """The result, or none for a cancelled flight."""
    try:
        return [flight.result()]
    except CancelledError:
        return []


def with_a_bar(
    jobs: Sequence[J],
    progress_text: Callable[[F], str],
    fly_one: Callable[[J], F],
    lose_one: Callable[[J, str], F],
) -> list[F]:
    """Fly all jobs with a progress bar, or lines in a log, from `progress_text`."""
    console = Console(stderr=True, highlight=False)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task("flying", total=len(jobs))
        done = count(1)

        def on_result(flown: F) -> None:
            if console.is_terminal:
                progress.update(bar, advance=1, description=progress_text(flown))
            else:
                console.print(f"{next(done)} of {len(jobs)}: {progress_text(flown)}")

        return fly_all(jobs, on_result, fly_one, lose_one)


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Worker(Generic[J, F]):
    """A process that flies one flight after another; replaced if it dies."""

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
    """A spawned process, because one with threads must not be forked; it ignores Ctrl-C."""
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(
        1, context, initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_IGN)
    )
