"""Tests of the results of survey campaigns."""

from sitl.bench.missions import Flown, Sketch
from sitl.bench.surveys import SurveyFlown, failed, sum_up
from sitl.scoring.report import Report


def survey(world: str, coverage: float, returns_m: tuple[float, ...]) -> SurveyFlown:
    """Result of a survey whose flights land that far from the pad, m."""
    row: Report = {
        "world": world,
        "seed": 1,
        "lost": False,
        "completed": True,
        "ending": "mission complete",
        "flights": len(returns_m),
        "collisions": 0,
        "away": sum(return_m > 0.3 for return_m in returns_m),
        "coverage": coverage,
        "return_m": max(returns_m),
    }
    sorties: tuple[Report, ...] = tuple(
        {"flight": number, "return_m": return_m, "ending": "landed"}
        for number, return_m in enumerate(returns_m, start=1)
    )
    sketch = Sketch([], [], [])
    return SurveyFlown(Flown(row, sketch), sorties, changes=({"kind": "new"},))


def test_surveys_are_summed_up() -> None:
    result = sum_up([survey("a", 0.9, (0.1, 0.2)), survey("b", 1.0, (0.5,))])
    totals = result["totals"]
    assert (totals["surveys"], totals["flights"], totals["away"]) == (2, 3, 1)
    assert (totals["coverage_median"], totals["coverage_min"]) == (0.95, 0.9)
    assert totals["return_max_m"] == 0.5
    assert result["rows"][0]["changes"] == ({"kind": "new"},)


def test_a_flight_that_lands_elsewhere_is_named() -> None:
    (line,) = failed([survey("a", 0.9, (0.1, 0.45))])
    assert line == "a, seed 1, flight 2: landed 0.45 m off the pad: landed"
