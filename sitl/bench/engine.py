"""Runs many jobs in parallel on Dask: on this machine's cores, or on a cluster.

jobs ─► one on each worker's thread ─► guarded run in a worker's process ─► results, as they come

Each job is given to a worker by name. Dask alone would queue a second job on a busy worker, and
would blame both if its process dies. A job that kills its process is run once more, and then lost:
it becomes a result that says why.
After Ctrl-C the running jobs end, and the results so far are returned.
"""

import logging
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Container, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from sitl.core.errors import SitlError
from sitl.core.program import program_version

if TYPE_CHECKING:
    from distributed import Client, Future, Worker

J = TypeVar("J")
F = TypeVar("F")

MAX_TRIES = 2
"""Most runs of a job whose process dies. Chosen: a machine may have been short of memory for other
reasons; a job that fails twice fails always."""
MEMORY_SHARE = 0.9
"""Share of a worker's memory limit at which its job is ended. On a cluster, Dask ends the process
without a reason at 0.95."""
CHECK_S = 0.5
"""Period of the check of a job's time and memory, s. Chosen."""
LIMIT_S = 6 * 3600.0
"""Default time after which a job is taken to hang, s. Chosen: a survey of six flights, with a long
single flight, takes one hour on a slow core."""
CONNECTS_S = 30.0
"""Timeout for the connection to a scheduler, and for its first worker, s. Chosen."""
TELLS_S = 3.0
"""Time for the reason to reach the scheduler before the process ends, s. Chosen: one second is too
short on a busy machine."""
SCHEDULER_LOST = "the scheduler has ended; start it again, and run the same command"
LOCAL = {
    # workers keep no results, and a job ends its own process in time, with a reason
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": False,
    # nobody reads the profile, for which a thread takes a sample every 10 ms
    "distributed.worker.profile.enabled": False,
    # each tick and each sample of the monitor requests the lock of the interpreter from the flight
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}
"""Dask's settings for workers on this machine."""
REASONS = "pdps-reasons"
"""Dask's event topic for the reasons why jobs were ended."""
ENDED_STATUS = 70
"""Exit status of a worker that ends with its job."""


class CampaignError(SitlError):
    """The scheduler has ended, or it or its workers cannot run the jobs."""


def attempted(job: J, run_one: Callable[[J], F], lose_one: Callable[[J, str], F]) -> F:
    """The result of a job; an exception becomes one by `lose_one`, and the campaign goes on."""
    try:
        return run_one(job)
    except Exception as error:
        return lose_one(job, f"{type(error).__name__}: {error}")


@dataclass(frozen=True, slots=True)
class Crew:
    """Where jobs run."""

    scheduler: str | None = None
    """Address of a Dask scheduler, e.g. tcp://127.0.0.1:8786; None: the cores of this machine."""
    workers: int | None = None
    """Processes on this machine; None: one for each core."""
    limit_s: float = LIMIT_S
    """Time after which a job is taken to hang, s."""
    memory: int | str = "auto"
    """Memory of a process on this machine, bytes; "auto": an equal share of the machine's."""


THIS_MACHINE = Crew()


def run_all(
    jobs: Sequence[J],
    on_result: Callable[[F], None],
    run_one: Callable[[J], F],
    lose_one: Callable[[J, str], F],
    crew: Crew = THIS_MACHINE,
) -> list[F]:
    """Run all jobs; return the results in their order. `on_result` is called after each job.

    Raises:
        CampaignError: the scheduler cannot be reached, has no workers, or they have another version
            of the program, or the scheduler has ended.
    """
    if not jobs:
        return []
    results: dict[int, F] = {}
    with _client(crew, len(jobs)) as client:
        batch = _Batch(client, jobs, _Guarded(run_one, program_version(), crew.limit_s))

        def keep(ended: Iterator[tuple[int, F, str]]) -> None:
            for number, result, why in ended:
                results[number] = lose_one(jobs[number], why) if why else result
                on_result(results[number])

        try:
            keep(batch.results())
        except KeyboardInterrupt:
            keep(batch.rest())
    return [results[number] for number in sorted(results)]


def with_a_bar(
    jobs: Sequence[J],
    progress_text: Callable[[F], str],
    run_one: Callable[[J], F],
    lose_one: Callable[[J, str], F],
    crew: Crew = THIS_MACHINE,
    *,
    has_failed: Callable[[F], bool] | None = None,
) -> list[F]:
    """Run all jobs with a progress bar, or lines in a log, from `progress_text`.

    The bar also has the time left, and the number of failures so far, if `has_failed` tells them.
    """
    console = Console(stderr=True, highlight=False)
    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[failures]}{task.description}"),
    )
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        bar = progress.add_task("flying", total=len(jobs), failures="")
        done, failures = count(1), 0

        def on_result(result: F) -> None:
            nonlocal failures
            failures += has_failed is not None and has_failed(result)
            failed = f"{failures} failed  " if has_failed else ""
            text = progress_text(result)
            if console.is_terminal:
                progress.update(bar, advance=1, description=text, failures=failed)
            else:
                console.print(f"{next(done)} of {len(jobs)}: {text}")

        return run_all(jobs, on_result, run_one, lose_one, crew)


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True, slots=True)
class _Run:
    """A run of a job on a worker."""

    number: int
    worker: str
    """Address of the worker."""


class _Batch(Generic[J]):
    """Submits jobs, one to each thread of the workers, so that a dying process takes only one."""

    def __init__(self, client: "Client", jobs: Sequence[J], guarded: "_Guarded[J, Any]") -> None:
        self._client, self._jobs, self._guarded = client, jobs, guarded
        self._waiting = deque(range(len(jobs)))
        self._tries = Counter[int]()
        self._running: dict[Future[Any], _Run] = {}
        self._is_ending = False

    def results(self) -> Iterator[tuple[int, Any, str]]:
        """The number of each job, as it ends, with its result, or with the reason of its loss."""
        from distributed import CancelledError  # noqa: PLC0415 - slow to load

        try:
            while self._running or self._waiting:
                threads = self._client.nthreads()  # of each worker that is alive
                yield from self._on_dead_workers(threads)
                self._fill(threads)
                yield from self._next_ended()
        except (OSError, CancelledError) as error:
            raise CampaignError(SCHEDULER_LOST) from error

    def rest(self) -> Iterator[tuple[int, Any, str]]:
        """The jobs that run at present, as they end; no new ones."""
        self._is_ending = True
        self._waiting.clear()
        yield from self.results()

    def _fill(self, threads: dict[str, int]) -> None:
        """Give each idle thread a job."""
        busy = Counter(run.worker for run in self._running.values())
        for worker, number_of_threads in threads.items():
            for _ in range(number_of_threads - busy[worker]):
                if not self._waiting:
                    return
                number = self._waiting.popleft()
                self._tries[number] += 1
                job = self._jobs[number]
                future = self._client.submit(self._guarded, job, pure=False, workers=[worker])
                self._running[future] = _Run(number, worker)

    def _on_dead_workers(self, alive: Container[str]) -> Iterator[tuple[int, Any, str]]:
        """Take back the jobs of workers that have ended."""
        for future, run in list(self._running.items()):
            if run.worker not in alive and not future.done():
                future.cancel()
                yield from self._died(future)

    def _next_ended(self) -> Iterator[tuple[int, Any, str]]:
        """Wait for a job to end, but at most `CHECK_S`."""
        from distributed import wait  # noqa: PLC0415 - slow to load

        if not self._running:  # no worker is alive
            time.sleep(CHECK_S)
            return
        try:
            ended = wait(list(self._running), timeout=CHECK_S, return_when="FIRST_COMPLETED")
        except TimeoutError:
            return
        for future in ended.done:
            yield from self._ended(future)

    def _ended(self, future: "Future[Any]") -> Iterator[tuple[int, Any, str]]:
        from distributed import KilledWorker  # noqa: PLC0415 - slow to load

        try:
            result = future.result(timeout=CONNECTS_S)
        except (KilledWorker, TimeoutError):  # its process has ended, or ended with the result
            yield from self._died(future)
        except CampaignError:
            raise
        except Exception as error:
            raise CampaignError(
                f"a worker cannot run the jobs: {type(error).__name__}: {error}"
            ) from error
        else:
            yield self._running.pop(future).number, result, ""

    def _died(self, future: "Future[Any]") -> Iterator[tuple[int, Any, str]]:
        """The job's process has ended: run it again, or give it up."""
        number = self._running.pop(future).number
        if self._tries[number] < MAX_TRIES:
            if not self._is_ending:
                self._waiting.append(number)
            return
        told = [entry for _, entry in self._client.get_events(REASONS)]
        reasons = {entry["key"]: entry["why"] for entry in told}
        yield number, None, reasons.get(future.key, "its process died")


@dataclass(frozen=True, slots=True)
class _Guarded(Generic[J, F]):
    """What runs on a worker: one job, whose process ends if it hangs or needs too much memory."""

    run_one: Callable[[J], F]
    program: str
    limit_s: float

    def __call__(self, job: J) -> F:
        from distributed import get_worker  # noqa: PLC0415 - slow to load

        worker = get_worker()
        if program_version() != self.program:
            raise CampaignError(_other_version({worker.address: program_version()}, self.program))
        done = threading.Event()
        told = worker, worker.get_current_task(), self.limit_s, done
        threading.Thread(target=_watch, args=told, daemon=True).start()
        try:
            return self.run_one(job)
        finally:
            done.set()


def _watch(worker: "Worker", key: str, limit_s: float, done: threading.Event) -> None:
    """End the process, with the reason, if the job takes too long or too much memory."""
    began_s = time.monotonic()
    memory = MEMORY_SHARE * (worker.memory_manager.memory_limit or float("inf"))
    while not done.wait(CHECK_S):
        why = ""
        if time.monotonic() - began_s > limit_s:
            why = f"no result after {limit_s:.0f} s"
        if worker.monitor.get_process_memory() > memory:
            why = f"out of memory: more than {memory / 1e6:.0f} MB"
        if why:
            worker.log_event(REASONS, {"key": key, "why": why})
            time.sleep(TELLS_S)
            os._exit(ENDED_STATUS)


@contextmanager
def _client(crew: Crew, jobs: int) -> Iterator["Client"]:
    """A client of workers that have the same version of the program."""
    import dask  # noqa: PLC0415 - slow to load
    from distributed import Client, LocalCluster  # noqa: PLC0415

    for name in ("distributed", "distributed.client"):  # results and errors say what went wrong
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if crew.scheduler is None:
        number = min(crew.workers or cores(), jobs)
        with (
            dask.config.set(LOCAL),
            LocalCluster(
                n_workers=number,
                threads_per_worker=1,
                memory_limit=crew.memory,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster) as client,
        ):
            client.run(_ignore_ctrl_c, nanny=False)
            yield client
        return
    try:
        client = Client(crew.scheduler, timeout=CONNECTS_S)
    except (OSError, ValueError) as error:
        raise CampaignError(
            f"--scheduler {crew.scheduler}: {error}; start one: dask scheduler --host 127.0.0.1"
        ) from error
    with client:
        _check_workers(client, crew.scheduler)
        yield client


def _check_workers(client: "Client", scheduler: str) -> None:
    """Raises: CampaignError: there is no worker, or one has another version of the program."""
    try:
        client.wait_for_workers(1, timeout=CONNECTS_S)
    except TimeoutError as error:
        raise CampaignError(
            f"--scheduler {scheduler}: it has no workers; start some: "
            f"dask worker {scheduler} --nthreads 1"
        ) from error
    own = program_version()
    versions = client.run(program_version, on_error="return")
    others = {address: str(each) for address, each in versions.items() if each != own}
    if others:
        raise CampaignError(_other_version(others, own))


def _other_version(others: dict[str, str], own: str) -> str:
    told = ", ".join(f"{address} has {version}" for address, version in others.items())
    return f"workers need the program {own}, but {told}; install the same on all machines"


def _ignore_ctrl_c() -> None:
    """Ctrl-C in a terminal reaches all its processes; running jobs end by themselves."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
