"""The time to scan a room once, of one drone or several."""

from companion.ticks import Progress
from sitl.bench.scan_time import TRACING, TURNING, ScanTime


def seen(*ticks: tuple[float, str]) -> float | None:
    scan = ScanTime()
    for time_s, activity in ticks:
        scan.watch(Progress(time_s, activity, "", tuple))
    return scan.seconds


def test_it_is_from_the_opening_turn_to_the_end_of_the_first_round() -> None:
    ticks = (5.0, "taking off"), (8.0, TURNING), (20.0, TRACING), (50.0, TRACING)
    assert seen(*ticks, (51.0, "scanning again"), (90.0, "landing")) == 42.0


def test_of_a_team_it_lasts_from_the_first_drone_to_the_last() -> None:
    assert seen((8.0, TURNING), (9.0, TURNING), (30.0, TRACING), (34.0, TRACING)) == 26.0


def test_without_a_scan_there_is_none() -> None:
    assert seen((8.0, TURNING), (9.0, "exploring")) is None
