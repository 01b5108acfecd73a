"""Tests that pieces of one wall are one wall, and what is not one wall stays apart."""

import pytest

from companion.core.frames import Vector2
from companion.core.messages import WallSegment
from companion.view.scene.joined import joined


def wall(start: Vector2, end: Vector2, hits: int = 10) -> WallSegment:
    return WallSegment(start, end, 0.05, hits)


def test_pieces_beside_and_over_each_other_are_one_wall() -> None:
    pieces = [wall((0, 0), (0.02, 3)), wall((0.03, 3.1), (0.05, 9)), wall((0.1, 2), (0.1, 4))]
    [whole] = joined(pieces)
    assert whole.length_m == pytest.approx(9, abs=0.05)
    assert whole.hits == 30
    assert whole.start_ne_m[1] == pytest.approx(0, abs=0.05)


def test_both_sides_of_a_wall_and_both_walls_of_a_doorway_stay_apart() -> None:
    sides = [wall((0, 0), (0, 5)), wall((0.1, 5), (0.1, 0))]
    beyond_a_doorway = wall((0, 5.9), (0, 9))
    corner = wall((0, 0), (4, 0))
    walls = [*sides, beyond_a_doorway, corner]
    assert set(joined(walls)) == set(walls)


def test_no_walls_are_no_walls() -> None:
    assert joined(()) == ()
