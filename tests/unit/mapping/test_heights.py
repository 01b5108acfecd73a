"""Floor and table tops from the down beam."""

import pytest

from companion.core.messages import Beam, Pose, RangeReading, RangeScan, RangeState
from companion.mapping.heights import Heights

OFFSET_M = 0.08


def flown_over(tops_m: dict[tuple[int, int], float], height_m: float = 2.0) -> Heights:
    """A flight in lines over a room of 4 × 4 m; tops by decimetres (north, east)."""
    heights = Heights(OFFSET_M)
    for north in range(40):
        for east in range(40):
            down_m = height_m - tops_m.get((north, east), 0.0) - OFFSET_M
            reading = RangeReading(RangeState.DISTANCE, down_m + 0.01 * ((north % 3) - 1), 1e-4)
            pose = Pose(0.0, north / 10 + 0.05, east / 10 + 0.05, -height_m, 0.0)
            heights.see(RangeScan(0.0, {Beam.DOWN: reading}), pose)
    return heights


def block(north: range, east: range, top_m: float) -> dict[tuple[int, int], float]:
    return {(n, e): top_m for n in north for e in east}


def test_an_empty_room_has_a_floor_and_no_table_tops() -> None:
    heights = flown_over({})
    assert heights.floor_m == pytest.approx(0, abs=0.01)
    assert heights.tops() == ()


def test_table_tops_are_found_with_their_heights_and_places() -> None:
    tables = block(range(4, 12), range(4, 20), 0.72) | block(range(24, 32), range(4, 12), 1.1)
    desk, shelf = flown_over(tables).tops()
    assert desk.height_m == pytest.approx(0.72, abs=0.02)
    assert desk.centre_ne_m == pytest.approx((0.8, 1.2), abs=0.1)
    assert desk.area_m2 == pytest.approx(0.8 * 1.6, rel=0.2)
    assert shelf.height_m == pytest.approx(1.1, abs=0.02)


def test_adjacent_tops_of_two_heights_are_distinguished() -> None:
    steps = block(range(4, 12), range(4, 12), 0.4) | block(range(4, 12), range(12, 20), 0.8)
    assert sorted(round(top.height_m, 1) for top in flown_over(steps).tops()) == [0.4, 0.8]


def test_the_floor_is_found_in_a_room_with_much_furniture() -> None:
    heights = flown_over(block(range(0, 40), range(0, 12), 0.72))
    assert heights.floor_m == pytest.approx(0, abs=0.02)


def test_the_floor_is_unknown_without_detections() -> None:
    heights = Heights(OFFSET_M)
    heights.see(RangeScan(0.0, {Beam.DOWN: RangeReading(RangeState.NOTHING)}), Pose(0, 0, 0, 0, 0))
    assert heights.floor_m is None
    assert heights.tops() == ()


def test_a_table_top_that_two_flights_saw_in_part_is_one() -> None:
    table = block(range(4, 12), range(4, 20), 0.72)
    halves = [
        {cell: top_m for cell, top_m in table.items() if (cell[1] < 14) == is_west}
        for is_west in (True, False)
    ]
    joint = Heights(0.0)
    for half in halves:
        joint.know(flown_over(half).readings)
    (desk,) = joint.tops()
    assert desk.height_m == pytest.approx(0.72, abs=0.02)
    assert desk.centre_ne_m == pytest.approx((0.8, 1.2), abs=0.1)
    assert joint.floor_m == pytest.approx(0, abs=0.01)
