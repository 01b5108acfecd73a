"""Fixtures that several files of flights use."""

from pathlib import Path

import pytest

from tests.worlds import ROOM


@pytest.fixture
def small(tmp_path: Path) -> str:
    """A room for a flight of 50 s."""
    path = tmp_path / "small.toml"
    path.write_text(ROOM)
    return str(path)
