"""Draws the plans of many flights on one sheet."""

import math
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

from companion.core.figures import Axes, Figure, LineCollection, own_style
from companion.core.frames import Vector2
from sitl.bench.missions import Flown
from sitl.scoring.report import Report

PAPER, INK = "#fbfaf7", "#22333b"
TRUTH, MAPPED = "#7d8a93", "#e0425a"
PATHS = ("#2f7fc1", "#e08a1e", "#3f9c58", "#8a5fc2", "#1aa5a5", "#b0578d")
"""Colours of the first flight, the second, ..."""
GOOD, BAD = "#2a7f4f", "#c1121f"
CELL_INCHES, TITLE_INCHES, HEAD_INCHES = 3.0, 0.5, 0.35
"""Side of a plan, height of its title, and height of the sheet's head, inches. Chosen."""
DPI = 120
"""Resolution of the sheet, dots per inch. Chosen."""
MAX_COLUMNS = 10
"""Largest number of plans in a row. Chosen."""
MAX_LETTERS = 66
"""Length at which the lines of a title are cut, characters. Chosen."""
HEAD = (
    "grey: true walls   red: the map   other colours: the true path of each flight, ● start, "
    "× end of a failed flight"
)
FIGURES = (
    ("coverage", "coverage {:.0%}"),
    ("false_walls", "false walls {:.1%}"),
    ("clearance_m", "clearance {:.2f} m"),
    ("false_alarms", "alarms {:.0f}"),
)
"""Keys of rows, and their text, if known."""


@own_style()
def draw_sheet(flights: Sequence[Flown], path: Path) -> None:
    """Write a PNG: for every flight the true walls grey, the mapped ones red, the path blue."""
    columns = min(MAX_COLUMNS, math.ceil(math.sqrt(len(flights))))
    rows = math.ceil(len(flights) / columns)
    row_inches = CELL_INCHES + TITLE_INCHES
    width_inches, height_inches = columns * CELL_INCHES, rows * row_inches + HEAD_INCHES
    figure = Figure((width_inches, height_inches), dpi=DPI, facecolor=PAPER)
    top = 1 - 0.1 / height_inches
    figure.text(0.1 / width_inches, top, HEAD, fontsize=7, color=INK, va="top", wrap=True)
    for number, flown in enumerate(flights):
        row, column = divmod(number, columns)
        left = (column + 0.03) * CELL_INCHES / width_inches
        bottom = (rows - row - 1) * row_inches / height_inches
        size = 0.94 * CELL_INCHES / width_inches, 0.97 * CELL_INCHES / height_inches
        axes = figure.add_axes((left, bottom, *size))
        axes.set_axis_off()
        axes.set_aspect("equal", anchor="N")
        _draw(flown, axes)
    figure.savefig(path, format="png")


def _draw(flown: Flown, axes: Axes) -> None:
    sketch, row = flown.sketch, flown.row
    layers: list[tuple[Sequence[Sequence[Vector2]], str, float]] = [
        (sketch.truth, TRUTH, 1.0),
        (sketch.mapped, MAPPED, 1.4),
    ]
    layers += [
        ([path], colour, 0.8) for path, colour in zip(sketch.paths, cycle(PATHS), strict=False)
    ]
    for lines, colour, width in layers:
        flat = [[_east_north(point) for point in line] for line in lines]
        axes.add_collection(LineCollection(flat, colors=colour, linewidths=width))
    axes.autoscale_view()
    colour = GOOD if row["completed"] else BAD
    if sketch.paths:
        axes.plot(*_east_north(sketch.paths[0][0]), marker="o", markersize=4, color=PATHS[0])
        if not row["completed"]:
            end = _east_north(sketch.paths[-1][-1])
            axes.plot(*end, marker="x", markersize=8, color=BAD, mew=2)
    axes.set_title(_title(row), fontsize=6, parse_math=False, color=colour)


def _title(row: Report) -> str:
    """Flight, ending and scores."""
    clutter = f", clutter {row['clutter']:g}" if row.get("clutter") else ""
    verdict = "completed" if row["completed"] else str(row["ending"])
    if row.get("collisions"):
        verdict = f"collisions: {row['collisions']}"
    scores = [form.format(row[key]) for key, form in FIGURES if row.get(key) is not None]
    lines = (
        f"{row['world']}{clutter}, start {row['start']}, seed {row['seed']}",
        f"{row['profile']}: {verdict}",
        ", ".join(scores),
    )
    return "\n".join(line[:MAX_LETTERS] for line in lines)


def _east_north(point: Vector2) -> Vector2:
    north, east = point
    return east, north
