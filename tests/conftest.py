"""Configures hypothesis, and marks each test with its layer.

All machines use the same examples, and examples have no deadline, so a busy machine does not fail.
`pytest --hypothesis-profile search` searches for new examples at random, and `fast` uses a fifth of
the examples.

A test's layer is its folder: `pytest -m contract`. A test that flies or starts a program gets that
marker in any folder. Those files run first, so that no worker is left alone with one at the end.

One worker runs all tests of a group: those of a file that flies nothing, which is quicker than to
distribute them, and those that share a flight, whose file names their group.
"""

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.register_profile("fast", deadline=None, derandomize=True, max_examples=20)
settings.load_profile("same")

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        layer = item.path.relative_to(HERE).parts[0] if HERE in item.path.parents else "flights"
        if not (layer == "unit" and flies_or_starts(item)):
            item.add_marker(layer)
    slow = {item.path for item in items if flies_or_starts(item)}
    items.sort(key=lambda item: item.path not in slow)
    for item in items:
        if item.path not in slow:
            item.add_marker(pytest.mark.xdist_group(str(item.path)))


def flies_or_starts(item: pytest.Item) -> bool:
    """True for a test that flies or starts a program."""
    return any(map(item.get_closest_marker, ("flights", "processes")))
