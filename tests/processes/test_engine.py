"""Tests of jobs in parallel: workers that die, hang, take memory, or have another version."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from sitl.bench import engine
from sitl.bench.engine import THIS_MACHINE, CampaignError, Crew, run_all
from tests.processes.jobs import Result, lose, lose_in, misbehave, work
from tests.processes.started import free_tcp_port


@contextmanager
def dask(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "dask", *arguments]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as started:
        try:
            yield started
        finally:
            started.kill()  # a worker whose scheduler has ended may ignore SIGTERM


@dataclass
class Cluster:
    """A scheduler, its address, and two workers, each a process of its own."""

    scheduler: subprocess.Popen[bytes]
    address: str


@pytest.fixture
def cluster() -> Iterator[Cluster]:
    port = free_tcp_port()
    address = f"tcp://127.0.0.1:{port}"
    worker = ("worker", address, "--nthreads=1", "--no-nanny", "--no-dashboard", "--host=127.0.0.1")
    listening = ("--host=127.0.0.1", f"--port={port}", "--dashboard-address=127.0.0.1:0")
    with dask("scheduler", *listening) as scheduler, dask(*worker), dask(*worker):
        yield Cluster(scheduler, address)


def test_jobs_that_die_hang_or_take_all_memory_say_so_and_the_others_run(tmp_path: Path) -> None:
    """The one that dies once runs again."""
    crew = Crew(workers=2, limit_s=3.0, memory=400_000_000)
    jobs = [(number, tmp_path) for number in range(6)]
    assert run_all(jobs, lambda _: None, misbehave, lose_in, crew) == [
        (0, ""),
        (1, ""),
        (2, "its process died"),
        (3, "no result after 3 s"),
        (4, "out of memory: more than 360 MB"),
        (5, ""),
    ]


def test_workers_of_a_scheduler_give_the_same_results_unless_their_version_differs(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    came: list[Result] = []
    crew = Crew(scheduler=cluster.address)
    results = run_all(range(20), came.append, work, lose, crew)
    assert sorted(came) == results
    assert results == run_all(range(20), lambda _: None, work, lose, Crew(workers=1))
    monkeypatch.setattr(engine, "program_version", lambda: "0.0.1+old")
    with pytest.raises(CampaignError, match=r"need the program 0\.0\.1\+old, but tcp://"):
        run_all(range(2), lambda _: None, work, lose, crew)


def test_a_scheduler_that_is_killed_is_told_with_the_remedy(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    crew = Crew(scheduler=cluster.address)
    run_all(range(1), lambda _: None, work, lose, crew)  # the workers have started
    monkeypatch.setattr(engine, "CONNECTS_S", 3.0)
    came: list[Result] = []

    def kill_it(result: Result) -> None:
        came.append(result)
        cluster.scheduler.kill()

    with pytest.raises(CampaignError, match="the scheduler has ended; start it again"):
        run_all(range(2000), kill_it, work, lose, crew)
    assert came


def test_a_missing_scheduler_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "CONNECTS_S", 1.0)
    nobody = replace(THIS_MACHINE, scheduler=f"tcp://127.0.0.1:{free_tcp_port()}")
    with pytest.raises(CampaignError, match=r"--scheduler tcp://.*dask scheduler"):
        run_all(range(2), lambda _: None, work, lose, nobody)
