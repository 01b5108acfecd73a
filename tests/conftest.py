"""Configures hypothesis, and marks each test with its layer.

All machines use the same examples, and examples have no deadline, so a busy machine does not fail.
`pytest --hypothesis-profile search` searches for new examples at random, and `fast` uses a fifth of
the examples.

A test's layer is its folder: `pytest -m contract`. A test that flies or starts a program gets that
marker in any folder. Those files run first, so that no worker is left alone with one at the end.

Tests are distributed to workers file by file, so that a flight that a file's tests share is flown
once. Those of the slow layers are distributed one by one.
"""

from pathlib import Path

import pytest
from hypothesis import settings
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.register_profile("fast", deadline=None, derandomize=True, max_examples=20)
settings.load_profile("same")

HERE = Path(__file__).parent
ONE_BY_ONE = "tests/processes", "tests/flights", "examples"
"""Folders whose files would occupy one worker for minutes."""


class FileScheduling(LoadScopeScheduling):
    """Distributes tests to workers file by file, or one by one."""

    def _split_scope(self, nodeid: str) -> str:
        return nodeid if nodeid.startswith(ONE_BY_ONE) else nodeid.partition("::")[0]


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> FileScheduling:
    return FileScheduling(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        layer = item.path.relative_to(HERE).parts[0] if HERE in item.path.parents else "flights"
        if not (layer == "unit" and flies_or_starts(item)):
            item.add_marker(layer)
    slow = {item.path for item in items if flies_or_starts(item)}
    items.sort(key=lambda item: item.path not in slow)


def flies_or_starts(item: pytest.Item) -> bool:
    """True for a test that flies or starts a program."""
    return any(map(item.get_closest_marker, ("flights", "processes")))
