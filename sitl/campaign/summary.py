"""Summary of a campaign: scores of all flights, and by each value of what was varied."""

from collections.abc import Sequence
from typing import Any

from rich.table import Table

from sitl.campaign.scores import SCORES, Mean, Row, values

NOT_GROUPED = ("seed", "clutter_seed")
"""Settings whose single values mean nothing."""
IN_TERMINAL = ("wall_error_aligned_cm", "coverage", "flight_time_s")
"""Scores that fit into a terminal; `summary.json` has all."""
MAX_GROUPS = 60
"""Most values of one setting that are listed. Chosen."""


def sum_up(rows: Sequence[Row], varied: Sequence[str], wanted: int) -> dict[str, Any]:
    """The summary, for `summary.json`. `wanted`: flights of the campaign."""
    groups = [
        {"setting": key, "value": value, **_summary(those)}
        for key in varied
        if key not in NOT_GROUPED
        for value, those in grouped(rows, key)
    ]
    return {"wanted": wanted, **_summary(list(rows)), "groups": groups}


def grouped(rows: Sequence[Row], key: str) -> list[tuple[Any, list[Row]]]:
    """The rows by their value of a setting; numbers in their order."""
    found: dict[Any, list[Row]] = {}
    for row in rows:
        found.setdefault(row.get(key), []).append(row)
    if len(found) > MAX_GROUPS:
        return []
    are_numbers = all(isinstance(value, int | float) for value in found)
    return sorted(found.items()) if are_numbers else list(found.items())


def _summary(rows: list[Row]) -> dict[str, Any]:
    scores = {each.key: Mean.of(values(rows, each)).as_json(each.scale) for each in SCORES}
    return {
        "flights": len(rows),
        "completed": sum(bool(row["completed"]) for row in rows),
        "lost": sum(bool(row["lost"]) for row in rows),
        "scores": scores,
    }


def summary_table(summary: dict[str, Any]) -> Table:
    """The summary for the terminal: means with 95 % confidence intervals."""
    shown = [each for each in SCORES if summary["scores"][each.key] and each.key in IN_TERMINAL]
    table = Table("", "flights", "done", "lost", *(score.title for score in shown))
    for row in (*summary["groups"], summary):
        name = f"{row['setting']} = {_shown(row['value'])}" if "setting" in row else "all"
        cells = [str(row[key]) for key in ("flights", "completed", "lost")]
        for score in shown:
            found = row["scores"][score.key]
            cells.append("" if found is None else with_interval(found, score.form, score.scale))
        table.add_row(name, *cells)
    return table


def with_interval(found: dict[str, float | None], form: str, scale: float) -> str:
    """A mean with its interval, as text."""
    mean, half = form.format(scale * (found["mean"] or 0.0)), found["half"]
    return mean if half is None else f"{mean} ± {form.format(scale * half)}"


def _shown(value: object) -> str:
    return "default" if value is None else str(value)
