"""Many flights at once, each lane a process; a process that dies loses only its own flight."""

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from queue import SimpleQueue

from rich.console import Console
from rich.progress import Progress

from sitl.bench.missions import Flown, Job, fly, lost


def fly_all(
    jobs: Sequence[Job], tell: Callable[[Flown], None], fly_one: Callable[[Job], Flown] = fly
) -> list[Flown]:
    """All flights in the order of the jobs; `tell` hears of each as it ends."""
    number = min(cores(), len(jobs))
    lanes: SimpleQueue[_Lane] = SimpleQueue()
    for _ in range(number):
        lanes.put(_Lane())

    def on_a_lane(job: Job) -> Flown:
        lane = lanes.get()
        try:
            return lane.fly(job, fly_one)
        finally:
            lanes.put(lane)

    with ThreadPoolExecutor(max(number, 1)) as crew:
        flights = [crew.submit(on_a_lane, job) for job in jobs]
        for flight in as_completed(flights):
            tell(flight.result())
    for _ in range(number):
        lanes.get().close()
    return [flight.result() for flight in flights]


def fly_and_show(jobs: Sequence[Job]) -> list[Flown]:
    """The same with a bar on stderr, where it is not in the way of what is printed."""
    with Progress(console=Console(stderr=True, highlight=False), transient=True) as progress:
        bar = progress.add_task("flying", total=len(jobs))

        def tell(flown: Flown) -> None:
            verdict = "completed" if flown.row["completed"] else "not completed"
            progress.update(bar, advance=1, description=f"{flown.row['world']} {verdict}")

        return fly_all(jobs, tell)


def cores() -> int:
    """That this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Lane:
    """A process for one flight after another, and a new one when it has died."""

    def __init__(self) -> None:
        self._process = _process()

    def fly(self, job: Job, fly_one: Callable[[Job], Flown]) -> Flown:
        try:
            return self._process.submit(fly_one, job).result()
        except BrokenProcessPool:
            self.close()
            self._process = _process()
            return lost(job, "its process died")

    def close(self) -> None:
        self._process.shutdown()


def _process() -> ProcessPoolExecutor:
    """Spawned: a process with threads must not be forked."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
