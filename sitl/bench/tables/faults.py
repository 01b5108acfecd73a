"""Prints the results of flights with faults as a table."""

from rich import box
from rich.table import Table

from sitl.bench.faults import FaultFlown, Summary, is_wrong

COLUMNS = (
    "flights",
    "completed",
    "landed",
    "handed_over",
    "failed",
    "collisions",
    "fly_aways",
    "maps_lost",
)


def progress_text(flown: FaultFlown) -> str:
    """Result of one flight, for the progress bar."""
    verdict = "FAILED" if is_wrong(flown.row) else "ended safely"
    return f"{flown.row['fault']} {verdict}"


def fault_table(result: Summary) -> Table:
    """A row per fault, and one for all."""
    table = Table("fault", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for column in COLUMNS:
        table.add_column(column.replace("_", "\n"), justify="right")
    for row in result["faults"]:
        table.add_row(row["fault"], *(str(row[column]) for column in COLUMNS))
    table.add_section()
    table.add_row("all", *(str(result[column]) for column in COLUMNS))
    return table
