"""Waits for conditions, with one deadline for all tests."""

import threading
import time
from collections.abc import Callable

PAUSE = threading.Event()
"""Event that is never set: a wait for it is a pause."""
DEADLINE_S = 240
"""Time after which a program or thread that hangs fails its test, s. Chosen: several times what
any of them needs on two busy cores, because a deadline must not measure the machine."""


def until(holds: Callable[[], bool], what: str) -> None:
    """Wait until a condition holds; the test fails at the deadline."""
    end_s = time.monotonic() + DEADLINE_S
    while not holds():
        assert time.monotonic() < end_s, f"{what} not within {DEADLINE_S} s"
        PAUSE.wait(0.05)
