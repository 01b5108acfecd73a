"""What the flights with faults came to, for the terminal."""

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


def told(flown: FaultFlown) -> str:
    """Of one flight, beside the bar."""
    verdict = "WENT WRONG" if is_wrong(flown.row) else "ended well"
    return f"{flown.row['fault']} {verdict}"


def fault_table(result: Summary) -> Table:
    """A row for each fault, and one for all."""
    table = Table("fault", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for column in COLUMNS:
        table.add_column(column.replace("_", "\n"), justify="right")
    for row in result["faults"]:
        table.add_row(row["fault"], *(str(row[column]) for column in COLUMNS))
    table.add_section()
    table.add_row("all", *(str(result[column]) for column in COLUMNS))
    return table
