"""Fixtures that several tests of the importers use."""

from pathlib import Path

import pytest

from sitl.world.loading import load_world
from tests.unit.sitl.world.room_files import ABSOLUTE, plan


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all hypothesis examples share; each example overwrites its files."""
    return tmp_path_factory.mktemp("importers")


@pytest.fixture
def truth(tmp_path: Path) -> list[tuple[float, ...]]:
    path = tmp_path / "truth.obj"
    path.write_text(ABSOLUTE)
    return plan(load_world(str(path)))
