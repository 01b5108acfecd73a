"""How properties are searched, and which layer each test belongs to.

A change is judged by the same examples on every machine, and a busy machine is no failure: no
example has a deadline. `pytest --hypothesis-profile search` looks for new ones, at random.

A test's layer is the folder that it is in: `pytest -m contract`. A test that flies, or that starts
a program, is marked so wherever it is.
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
