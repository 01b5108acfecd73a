"""The pytest plugin: a fixture `sitl` that flies missions; files are beside the test.

pytest loads it for every test in an environment where this package is installed, also for those
that never fly, and without the extra `sitl`: so the simulator is loaded when a test asks for it.
"""

from typing import TYPE_CHECKING

import pytest

from companion.core.errors import MissingExtraError
from companion.core.extras import needs_extra

if TYPE_CHECKING:
    from sitl.testing.flight import Sitl


@pytest.fixture
def sitl(request: pytest.FixtureRequest) -> "Sitl":
    """Simulated flights; see docs/testing.md."""
    try:
        with needs_extra("sitl"):
            from sitl.testing.flight import Sitl  # noqa: PLC0415 - an extra
    except MissingExtraError as missing:
        told = str(missing)
    else:
        return Sitl(request.path.parent)
    pytest.fail(told, pytrace=False)
