"""Tests of the output of `sitl bench accuracy`."""

from typing import Any

from sitl.bench.accuracy_table import lost_flights


def test_each_flight_that_was_not_completed_is_told_with_its_seed_and_end() -> None:
    row: dict[str, Any] = {"world": "office", "profile": "paper"}
    rows = [row | {"lost_by_seed": {}}, row | {"lost_by_seed": {7: "landed: no way back"}}]
    assert lost_flights(rows) == ["office, paper, seed 7: landed: no way back"]
