"""The grid is drawn from rays, and redrawn after corrections of the trajectory."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.mapping import redrawn_grid as spaces
from companion.mapping.occupancy import Occupancy
from companion.mapping.packed_grid import PackedGrid
from companion.mapping.rays import Ray
from companion.mapping.redrawn_grid import RedrawnGrid

STEP_M, KEYFRAMES = 0.1, 400
LAST = 40
"""Keyframes that are corrected at the end."""
A_HIT = 0.01, True, 0.0
"""Sigma, hit, and time."""


@pytest.fixture
def forgetful(monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory limits as after an hour of flight."""
    monkeypatch.setattr(spaces, "MAX_RAYS", 900)


def way_north() -> np.ndarray:
    return np.outer(np.arange(KEYFRAMES), (STEP_M, 0.0, 0.0))


def along_a_corridor() -> RedrawnGrid:
    """A corridor two metres wide.

    Each keyframe has perpendicular and oblique hits on both walls.
    """
    space, keyframes = RedrawnGrid(rays_per_stage=50), way_north()
    for k, (north_m, _, _) in enumerate(keyframes.tolist()):
        rays = [
            Ray((north_m, 0.0), side * math.radians(deg), 1 / math.sin(math.radians(deg)), *A_HIT)
            for side in (-1, 1)
            for deg in (60, 90)
        ]
        space.add([*rays, Ray((north_m, 0.0), 0.0, 0.5, 0.0, False, 0.0)], keyframes[: k + 1])
        draw(space)
    return space


def draw(space: RedrawnGrid) -> None:
    for _ in range(100):
        space.advance()


def is_known(space: RedrawnGrid, to_m: float) -> bool:
    """True if the middle is free and both walls are occupied."""
    grid = space.grid
    places = np.arange(1.0, to_m, STEP_M).tolist()
    is_free = all(grid.free[grid.cell((north_m, 0.05))] for north_m in places)
    stands = (0.85 < grid.nearest_m((north_m, 0.0), 1.3) < 1.15 for north_m in places)
    return is_free and all(stands)


@pytest.mark.usefixtures("forgetful")
def test_old_cells_stay_as_drawn_after_a_correction() -> None:
    """Regression: the return path of a long flight was reduced to single rays by a redraw."""
    space = along_a_corridor()
    assert is_known(space, STEP_M * KEYFRAMES - 1)
    corrected = way_north()
    corrected[-LAST:, 0] += 0.3
    space.correct(corrected)
    draw(space)
    assert is_known(space, STEP_M * KEYFRAMES - 1)


@pytest.mark.usefixtures("forgetful")
def test_recent_cells_are_corrected() -> None:
    space, corrected = along_a_corridor(), way_north()
    corrected[-LAST:, 1] += 0.5
    space.correct(corrected)
    draw(space)
    last_m, grid = STEP_M * (KEYFRAMES - LAST / 2), space.grid
    assert grid.free[grid.cell((last_m, 1.25))]
    assert not grid.free[grid.cell((last_m, -0.85))]


@pytest.mark.usefixtures("forgetful")
def test_a_correction_of_discarded_rays_changes_no_cell() -> None:
    space, corrected = along_a_corridor(), way_north()
    before = space.grid.free.copy()
    corrected[:100, 1] += 1.0
    space.correct(corrected)
    draw(space)
    assert (space.grid.free == before).all()


@given(
    ends=st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), max_size=6),
    is_above=st.booleans(),
)
def test_a_packed_grid_is_unpacked_as_it_was(
    ends: list[tuple[float, float]], is_above: bool
) -> None:
    grid = Occupancy()
    for north_m, east_m in ends:
        away_m = math.hypot(north_m, east_m)
        grid.add(Ray((0.0, 0.0), math.atan2(east_m, north_m), away_m, *A_HIT))
    if is_above:
        grid = grid.layer_above([(1.0, 0.0)])
    again = PackedGrid.of(grid).unpacked().arrays()
    for name, cells in grid.arrays().items():
        assert again[name].dtype == cells.dtype
        assert np.array_equal(again[name], cells)
