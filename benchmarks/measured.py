"""Measures the memory of a process, and of a function in a process of its own."""

import multiprocessing
import re
import resource
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import ParamSpec, TypeVar

import psutil

P = ParamSpec("P")
R = TypeVar("R")
POLL_S = 0.2
"""Interval at which the processes are looked at, s."""


def peak_mb() -> float:
    """Largest memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def peak_of_children_mb() -> float:
    """Largest memory of any process that this one has started and that has ended, MB."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024


def in_own_process(run: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Call a function in a new process, whose memory and children are those of the call alone."""
    spawned = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=1, mp_context=spawned) as pool:
        return pool.submit(run, *args, **kwargs).result()


def companions_mb(run: Callable[[], object]) -> list[float]:
    """Largest memory of each companion that a function flies in a process of its own, MB.

    In the order in which they were started.
    """
    peaks_mb: dict[int, float] = {}
    flying = Thread(target=run)
    flying.start()
    while flying.is_alive():
        for child in psutil.Process().children(recursive=True):
            with suppress(psutil.NoSuchProcess, FileNotFoundError):
                if "-m companion fly" in " ".join(child.cmdline()):
                    peaks_mb[child.pid] = _peak_of_mb(child.pid) or peaks_mb.get(child.pid, 0.0)
        flying.join(POLL_S)
    return [peaks_mb[process] for process in sorted(peaks_mb)]


def _peak_of_mb(process: int) -> float:
    """Largest memory of a running process so far, MB; 0 if it has just ended."""
    status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
    found = re.search(r"VmHWM:\s+(\d+) kB", status)
    return int(found[1]) / 1024 if found else 0.0
