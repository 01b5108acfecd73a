"""Jobs for tests of the engine; workers import them."""

import os
import signal
import time
from pathlib import Path

Result = tuple[int, str]


def work(number: int) -> Result:
    return number, ""


def lose(number: int, why: str) -> Result:
    return number, why


def misbehave(job: tuple[int, Path]) -> Result:
    """1 dies in its first run, 2 dies always, 3 hangs, and 4 takes all memory."""
    number, folder = job
    is_first = number == 1 and not (folder / "has run").exists()
    if is_first or number == 2:
        (folder / "has run").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 3:
        time.sleep(1e6)
    taken = []
    while number == 4:
        taken.append(bytearray(b"x" * 20_000_000))
        time.sleep(0.1)
    return number, ""


def lose_in(job: tuple[int, Path], why: str) -> Result:
    return lose(job[0], why)
