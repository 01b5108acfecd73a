"""Prints the results of `sitl bench accuracy` as tables."""

from typing import Any

from rich.table import Table

from sitl.bench.accuracy import ERRORS, ended

HEADINGS = ("aligned", "take-off", "ATE")


def accuracy_tables(rows: list[dict[str, Any]]) -> list[Table]:
    """Errors of each solver in cm, mean and 95th percentile; then the flights."""
    errors = Table("world, sensors", "solver", *(f"{heading}, cm" for heading in HEADINGS))
    flights = Table("world, sensors", "lost", "hit", "covered", "false", "claimed", "home", "CPU")
    for row in rows:
        name = f"{row['world']}\n{row['profile']}"
        errors.add_row(name, "companion", *_errors(row))
        errors.add_row("", "ideal", *_errors(row["ideal"]))
        errors.add_row("", "dead reckoning", *_errors(row["dead_reckoned"]), end_section=True)
        flights.add_row(
            name,
            f"{row['lost']} of {row['flights']}",
            f"{row['collisions']:.0f}",
            f"{row['coverage']['mean']:.1%}",
            f"{row['false_walls']['mean']:.2%}",
            f"{row['wall_sigma_cm']['mean']:.1f} cm\n{row['wall_error_sigmas']['mean']:.2f} sigmas",
            f"{row['home_m']['p95']:.2f} m",
            f"{row['cpu_ms_per_s']['mean']:.0f} ms/s\n{row['update_p99_ms']['p95']:.1f} ms",
        )
    return [errors, flights]


def lost_flights(rows: list[dict[str, Any]]) -> list[str]:
    """A line with the ending of each flight that was not completed."""
    return [
        ended(row["world"], row["profile"], seed, ending)
        for row in rows
        for seed, ending in row["lost_by_seed"].items()
    ]


def _errors(figures: dict[str, Any]) -> list[str]:
    return [f"{figures[key]['mean']:.1f} ({figures[key]['p95']:.1f})" for key in ERRORS]
