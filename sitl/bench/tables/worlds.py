"""Table of a campaign with a row for each world."""

from collections.abc import Callable, Sequence
from typing import Any

from rich import box
from rich.table import Table

Columns = Sequence[tuple[str, str]]
"""Heading and format of each column after the world's name."""


def world_table(
    result: dict[str, Any],
    columns: Columns,
    more: Callable[[dict[str, Any]], dict[str, Any]] = lambda row: {},
) -> Table:
    """A row for each of `result["rows"]`, and its totals as caption.

    `more` returns values for the formats besides those of a row.
    """
    table = Table("world", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for heading, _ in columns:
        table.add_column(heading, justify="right")
    for row in result["rows"]:
        values = row | more(row)
        table.add_row(row["world"], *(_cell(form, values) for _, form in columns))
    table.caption = ", ".join(f"{key}: {value}" for key, value in result["totals"].items())
    return table


def _cell(form: str, values: dict[str, Any]) -> str:
    try:
        return form.format(**values)
    except (KeyError, TypeError, ValueError):
        return "–"
