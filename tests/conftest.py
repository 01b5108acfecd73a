"""Configures hypothesis, and marks each test with its layer.

All machines use the same examples, and examples have no deadline, so a busy machine does not fail.
`pytest --hypothesis-profile search` searches for new examples at random.

A test's layer is its folder: `pytest -m contract`. A test that flies or starts a program gets that
marker in any folder.
"""

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("same")

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        layer = item.path.relative_to(HERE).parts[0] if HERE in item.path.parents else "flights"
        if not (layer == "unit" and any(map(item.get_closest_marker, ("flights", "processes")))):
            item.add_marker(layer)
