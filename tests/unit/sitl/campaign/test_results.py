"""Tests of the rows of campaigns: kept at once, read once, compared in pairs, and drawn."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.campaign.compare import NoPairsError, compare
from sitl.campaign.plots import save_plots
from sitl.campaign.results import JOIN_AT, Results, ResultsError, read_rows, save_table
from sitl.campaign.scores import Mean, Row
from sitl.campaign.summary import sum_up


def row(flight: int, program: str = "1", **more: object) -> Row:
    return {
        "flight": f"{flight:04d}",
        "program": program,
        "world": "room_100",
        "seed": flight,
        "completed": True,
        "lost": False,
        "ending": "mission complete",
        "wall_error_aligned_cm": 1.0 + 0.1 * flight,
        "coverage": 1.0,
        **more,
    }


def filled(folder: Path, rows: list[Row]) -> Path:
    results = Results(folder)
    for each in rows:
        results.add(each)
    return folder


def test_a_setting_may_be_a_number_in_one_row_and_text_in_another(tmp_path: Path) -> None:
    """The hundredth row of a campaign with `mission.standoff` of 1.5 and `range` was lost."""
    rows = [row(n, standoff=1.5 if n % 2 else "range") for n in range(JOIN_AT + 1)]
    assert read_rows(filled(tmp_path, rows)) == rows


def test_rows_come_back_in_their_order_with_their_types(tmp_path: Path) -> None:
    rows = [row(3, hits_north_m=[1.5, 2.0]), row(1, coverage=1), row(2, note="more", start="1")]
    assert read_rows(filled(tmp_path, rows)) == rows


def test_many_rows_are_joined_into_few_files_and_none_is_lost(tmp_path: Path) -> None:
    rows = [row(number) for number in range(2 * JOIN_AT + 7)]
    assert read_rows(filled(tmp_path, rows)) == rows
    assert len(list((tmp_path / "rows").glob("*.parquet"))) == 2 + 7
    assert len(Results(tmp_path).known) == len(rows)
    again = Results(tmp_path)
    again.add(row(5000))
    assert len(read_rows(tmp_path)) == len(rows) + 1


def test_a_crash_while_files_are_joined_doubles_no_row(tmp_path: Path) -> None:
    rows = [row(number) for number in range(3)]
    filled(tmp_path, rows)
    save_table(rows, tmp_path / "rows" / "0000003.parquet")
    (tmp_path / "rows" / ".unfinished-0000004.parquet").write_bytes(b"PAR1")
    assert read_rows(tmp_path) == rows


def test_a_broken_file_is_named(tmp_path: Path) -> None:
    filled(tmp_path, [row(1)])
    (tmp_path / "rows" / "0000000.parquet").write_bytes(b"nothing")
    with pytest.raises(ResultsError, match=r"0000000\.parquet: .*delete it"):
        read_rows(tmp_path)
    with pytest.raises(ResultsError, match="delete it"):
        Results(tmp_path)


def test_differences_are_paired_by_flight(tmp_path: Path) -> None:
    before = [row(number) for number in range(10)]
    after = [row(number, "2", wall_error_aligned_cm=0.9 + 0.1 * number) for number in range(2, 12)]
    after[0] |= {"completed": False, "ending": "landed: lost"}
    found = compare(filled(tmp_path / "a", before), filled(tmp_path / "b", after))
    assert found["pairs"] == 8
    error = found["scores"]["wall_error_aligned_cm"]
    assert error["mean"] == pytest.approx(-0.1)
    assert error["half"] == pytest.approx(0, abs=1e-9)
    assert found["no_longer_completed"] == ["room_100, seed 2: landed: lost"]
    assert found["newly_completed"] == []


def test_one_folder_is_compared_with_its_program_before(tmp_path: Path) -> None:
    filled(tmp_path, [row(1, "1"), row(1, "2", coverage=0.9)])
    found = compare(tmp_path, tmp_path)
    assert (found["before"]["program"], found["after"]["program"]) == ("1", "2")
    assert found["scores"]["coverage"]["mean"] == pytest.approx(-0.1)


def test_campaigns_without_equal_flights_are_not_compared(tmp_path: Path) -> None:
    one, other = filled(tmp_path / "a", [row(1)]), filled(tmp_path / "b", [row(2)])
    with pytest.raises(NoPairsError, match="no flights with equal settings"):
        compare(one, other)
    with pytest.raises(NoPairsError, match="rows of 1 programs"):
        compare(one, one)


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=50))
def test_the_interval_contains_the_mean_and_shrinks_with_more_values(values: list[float]) -> None:
    once, twice = Mean.of(values), Mean.of(values * 2)
    assert min(values) - 1e-6 <= once.mean <= max(values) + 1e-6
    assert once.half is not None
    assert twice.half is not None
    assert twice.half <= once.half + 1e-9


def test_the_summary_has_each_value_that_was_varied() -> None:
    rows = [row(number, battery_s=60.0 * (1 + number % 2)) for number in range(6)]
    rows.append({**row(6), "completed": False, "lost": True, "wall_error_aligned_cm": None})
    summary = sum_up(rows, ("seed", "battery_s"), 9)
    assert (summary["wanted"], summary["flights"], summary["lost"]) == (9, 7, 1)
    assert [(group["value"], group["flights"]) for group in summary["groups"]] == [
        (60.0, 3),
        (120.0, 3),
        (None, 1),
    ]
    assert summary["scores"]["wall_error_aligned_cm"]["n"] == 6


def test_plots_show_what_was_varied_and_where_drones_collided(tmp_path: Path) -> None:
    rows = [row(number, clutter=number / 100, mission="room") for number in range(60)]
    rows[7] |= {"hits_north_m": [2.0], "hits_east_m": [3.0]}
    saved = save_plots(rows, ("seed", "clutter"), tmp_path)
    assert [path.name for path in saved] == ["by_clutter.png", "collisions_room_100.png"]
    assert all(path.stat().st_size > 5000 for path in saved)
