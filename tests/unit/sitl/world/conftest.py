"""Fixtures that several tests of the importers use."""

from pathlib import Path

import pytest

from sitl.world.loading import load_world
from tests.unit.sitl.world.room_files import ABSOLUTE, plan


@pytest.fixture
def truth(tmp_path: Path) -> list[tuple[float, ...]]:
    path = tmp_path / "truth.obj"
    path.write_text(ABSOLUTE)
    return plan(load_world(str(path)))
