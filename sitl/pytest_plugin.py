"""Provides pytest's fixture `sitl`, which flies missions; their files are beside the test.

pytest loads this plugin in every environment that has the package, also without the extra `sitl`.
The fixture therefore imports the simulator only when a test requests it.
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
        reason = str(missing)
    else:
        return Sitl(request.path.parent)
    pytest.fail(reason, pytrace=False)
