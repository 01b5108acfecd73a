"""The pytest plugin: a fixture `sitl` that flies missions; files are beside the test."""

import pytest

from sitl.testing.flight import Sitl


@pytest.fixture
def sitl(request: pytest.FixtureRequest) -> Sitl:
    """Simulated flights; see docs/testing.md."""
    return Sitl(request.path.parent)
