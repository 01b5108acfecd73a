"""Many flights on one sheet of paper."""

import math
from collections.abc import Sequence
from pathlib import Path

from companion.figures import Axes, Figure, LineCollection
from companion.frames import Vector2
from sitl.bench.missions import Flown

PAPER = "#fbfaf7"
TRUTH, MAPPED, PATH = "#9aa5ad", "#d1495b", "#3a86c8"
GOOD, BAD = "#2a7f4f", "#c1121f"
CELL_INCHES, TITLE_INCHES = 2.2, 0.42
MOST_COLUMNS = 10
MOST_LETTERS = 45


def draw_sheet(flights: Sequence[Flown], path: Path) -> None:
    """PNG: for every flight the true walls grey, the mapped ones red, the true path blue."""
    columns = min(MOST_COLUMNS, math.ceil(math.sqrt(len(flights))))
    rows = math.ceil(len(flights) / columns)
    cell_inches = CELL_INCHES + TITLE_INCHES
    figure = Figure((columns * CELL_INCHES, rows * cell_inches), dpi=100, facecolor=PAPER)
    for number, flown in enumerate(flights):
        row, column = divmod(number, columns)
        bottom = 1 - (row + 1) / rows
        height = CELL_INCHES / cell_inches / rows
        axes = figure.add_axes((column / columns, bottom, 0.96 / columns, height))
        axes.set_axis_off()
        axes.set_aspect("equal")
        _draw(flown, axes)
    figure.savefig(path, format="png")


def _draw(flown: Flown, axes: Axes) -> None:
    sketch, row = flown.sketch, flown.row
    for lines, colour, width in (
        (sketch.truth, TRUTH, 1.6),
        (sketch.mapped, MAPPED, 1.0),
        ([sketch.path] if sketch.path else [], PATH, 0.7),
    ):
        flat = [[_east_north(point) for point in line] for line in lines]
        axes.add_collection(LineCollection(flat, colors=colour, linewidths=width))
    axes.autoscale_view()
    verdict = "completed" if row["completed"] else str(row["ending"])
    if row.get("collisions"):
        verdict = f"collisions: {row['collisions']}"
    flight = f"{row['world']}, start {row['start']}, seed {row['seed']}"
    title = f"{flight}\n{row['profile']}: {verdict}"
    axes.set_title(
        "\n".join(line[:MOST_LETTERS] for line in title.splitlines()),
        fontsize=6,
        parse_math=False,
        color=GOOD if row["completed"] else BAD,
    )


def _east_north(point: Vector2) -> Vector2:
    north, east = point
    return east, north
