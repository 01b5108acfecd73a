"""Summarises many flights, by world and profile, and in total."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from statistics import mean, median
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from sitl.scoring.report import Report

Summary = dict[str, Any]

FIGURES: tuple[tuple[str, str, Callable[[Iterable[float]], float]], ...] = (
    ("coverage_mean", "coverage", mean),
    ("coverage_median", "coverage", median),
    ("coverage_min", "coverage", min),
    ("false_walls_mean", "false_walls", mean),
    ("false_walls_max", "false_walls", max),
    ("clearance_min_m", "clearance_m", min),
    ("clearance_open_min_m", "clearance_open_m", min),
    ("return_mean_m", "return_m", mean),
    ("return_max_m", "return_m", max),
    ("trace_over_least_mean", "trace_over_least", mean),
    ("wall_error_aligned_mean_cm", "wall_error_aligned_cm", mean),
    ("flight_time_mean_s", "flight_time_s", mean),
)
"""Key in the summary, key in the rows, and function; rows without a value are ignored."""


def summarise(rows: Sequence[Report]) -> Summary:
    """Figures of a group of flights."""
    summary: Summary = {
        "flights": len(rows),
        "completed": sum(bool(row["completed"]) for row in rows),
        "lost": sum(bool(row["lost"]) for row in rows),
        "collisions": sum(int(row.get("collisions") or 0) for row in rows),
    }
    summary["false_alarms_per_h"] = _per_hour(rows, "false_alarms")
    for key, source, how in FIGURES:
        values = [float(value) for row in rows if (value := row.get(source)) is not None]
        summary[key] = round(how(values), 4) if values else None
    endings = Counter(_ending(row) for row in rows if not row["completed"])
    return {**summary, "endings": dict(endings.most_common())}


def _per_hour(rows: Sequence[Report], key: str) -> float | None:
    """Rate per hour in the air; rows without a value are ignored."""
    counted = [row for row in rows if row.get(key) is not None]
    hours = sum(float(row.get("flight_time_s") or 0.0) for row in counted) / 3600
    return round(sum(int(row[key] or 0) for row in counted) / hours, 1) if hours else None


def sum_up(rows: Sequence[Report]) -> Summary:
    """All rows, a summary per group, and a total: the output of `--json`."""
    return {"rows": rows, "groups": by_world(rows), "totals": summarise(rows)}


def show(result: Summary, console: Console) -> None:
    """Print the summary as a table, and the flights that were not completed."""
    console.print(summary_table(result["groups"], result["totals"]))
    for line in failed_flights(result["rows"]):
        console.print(line, soft_wrap=True, markup=False)


def by_world(rows: Sequence[Report]) -> list[Summary]:
    """A summary per world, profile and clutter, in the order of the rows."""
    names = list(dict.fromkeys(map(_group, rows)))
    ordered = sorted(rows, key=lambda row: names.index(_group(row)))
    return [
        {"world": world, "profile": profile, "clutter": clutter, **summarise(list(group))}
        for (world, profile, clutter), group in groupby(ordered, _group)
    ]


def _group(row: Report) -> tuple[str, str, float]:
    return str(row["world"]), str(row["profile"]), float(row.get("clutter") or 0.0)


def _ending(row: Report) -> str:
    """Ending of a flight that was not completed; a mission may end well after a collision."""
    if row.get("collisions"):
        return f"{row['ending']}; collisions: {row['collisions']}"
    return str(row["ending"])


UNKNOWN = "–"
Column = tuple[str, str]
"""Heading, and format of the summary's figures."""
SELDOM = ("clut-\nter", "trace\n×bound")
"""Columns that are left out if they have only zeros and unknowns."""

_COLUMNS: tuple[Column, ...] = (
    ("clut-\nter", "{clutter:g}"),
    ("done", "{completed}/{flights}"),
    ("hits", "{collisions}"),
    ("alarm\n/h", "{false_alarms_per_h:.0f}"),
    ("false\nwalls", "{false_walls_mean:.0%}"),
    ("coverage\nmean/min", "{coverage_mean:.0%}/{coverage_min:.0%}"),
    ("least\nclear", "{clearance_min_m:.2f}"),
    ("off start\nmean/max", "{return_mean_m:.2f}/{return_max_m:.2f}"),
    ("trace\n×bound", "{trace_over_least_mean:.2f}"),
    ("walls\ncm", "{wall_error_aligned_mean_cm:.1f}"),
    ("air\ns", "{flight_time_mean_s:.0f}"),
)


def summary_table(groups: Sequence[Summary], totals: Summary) -> Table:
    """The summary as a table, totals last; lengths in m unless given.

    A column of `SELDOM` without a value is left out.
    """
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=0)
    table.add_column("world", no_wrap=True)
    columns = [column for column in _COLUMNS if _has_content(column, groups)]
    for heading, _ in columns:
        table.add_column(heading, justify="right", no_wrap=True)
    for profile, group in groupby(groups, lambda group: group["profile"]):
        table.add_row(f"[bold]{profile}[/]")
        for summary in group:
            table.add_row(summary["world"], *_cells(summary, columns))
        table.add_section()
    table.add_row("all", *_cells(totals, columns))
    return table


def _has_content(column: Column, groups: Sequence[Summary]) -> bool:
    cells = (cell for summary in groups for cell in _cells(summary, [column]))
    return column[0] not in SELDOM or any(cell not in {UNKNOWN, "0"} for cell in cells)


def _cells(summary: Summary, columns: Sequence[Column]) -> list[str]:
    known = {key: value for key, value in summary.items() if value is not None}
    return [_cell(form, known) for _, form in columns]


def _cell(form: str, known: Summary) -> str:
    try:
        return form.format_map(known)
    except KeyError:
        return UNKNOWN


def failed_flights(rows: Sequence[Report]) -> list[str]:
    """A line for every flight that was not completed."""
    return [
        f"{row['world']}{_clutter(row)}, {row['profile']}, start {row['start']}, "
        f"seed {row['seed']}: {_ending(row)}"
        for row in rows
        if not row["completed"]
    ]


def _clutter(row: Report) -> str:
    return f", clutter {row['clutter']:g}" if row.get("clutter") else ""
