"""Configures hypothesis, and marks each test with its layer.

All machines use the same examples, and examples have no deadline, so a busy machine does not fail.
`pytest --hypothesis-profile search` searches for new examples at random, and `fast` uses a fifth of
the examples.

A test's layer is its folder: `pytest -m contract`. A test that flies or starts a program gets that
marker in any folder. Those files run first, so that no worker is left alone with one at the end.

Tests are distributed to workers file by file, so that a flight that a file's tests share is flown
once. Those of the slow layers are distributed one by one: tests that start programs, and wait for
them, among flights and solved logs, which need the processor all the time.
"""

import signal
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # a job in the background ignores Ctrl-C, and so would the programs that the tests start
    signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.register_profile("fast", deadline=None, derandomize=True, max_examples=20)
settings.load_profile("same")

HERE = Path(__file__).parent
COMPUTING = "tests/flights", "tests/logs", "examples"
"""Folders of tests that need the processor all the time."""
WAITING = "tests/processes", "tests/browser"
"""Folders of tests that start programs, and often wait."""
ONE_BY_ONE = *COMPUTING, "tests/processes"
"""Folders whose files would occupy one worker for minutes."""
SHARED = "tests/flights/test_attacker.py"
"""File in such a folder whose tests share a flight."""


class FileScheduling(LoadScopeScheduling):
    """Distributes tests to workers file by file, or one by one."""

    def _split_scope(self, nodeid: str) -> str:
        is_alone = nodeid.startswith(ONE_BY_ONE) and not nodeid.startswith(SHARED)
        return nodeid if is_alone else nodeid.partition("::")[0]


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> FileScheduling:
    return FileScheduling(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        layer = item.path.relative_to(HERE).parts[0] if HERE in item.path.parents else "flights"
        if not (layer == "unit" and flies_or_starts(item)):
            item.add_marker(layer)
    slow = {item.path for item in items if flies_or_starts(item)}
    first = mixed(
        *(
            [item for item in items if item.nodeid.startswith(layer)]
            for layer in (WAITING, COMPUTING)
        )
    )
    others = [item for item in items if not item.nodeid.startswith((*WAITING, *COMPUTING))]
    items[:] = [*first, *sorted(others, key=lambda item: item.path not in slow)]


def mixed(*groups: Sequence[pytest.Item]) -> list[pytest.Item]:
    """The items of all groups, each group in its order and spread evenly over the whole."""
    placed = [((at + 0.5) / len(group), item) for group in groups for at, item in enumerate(group)]
    return [item for _, item in sorted(placed, key=lambda each: each[0])]


def flies_or_starts(item: pytest.Item) -> bool:
    """True for a test that flies or starts a program."""
    return any(map(item.get_closest_marker, ("flights", "processes")))
