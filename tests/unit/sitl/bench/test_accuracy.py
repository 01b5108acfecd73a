"""Tests of the output of `sitl bench accuracy`."""

from typing import Any

from sitl.bench.tables.accuracy import lost_flights


def test_incomplete_flights_are_listed_with_seed_and_ending() -> None:
    row: dict[str, Any] = {"world": "office", "profile": "paper"}
    rows = [row | {"lost_by_seed": {}}, row | {"lost_by_seed": {7: "landed: no way back"}}]
    assert lost_flights(rows) == ["office, paper, seed 7: landed: no way back"]
