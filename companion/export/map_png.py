"""Draws the floor plan as a PNG image, with its main walls upright, a legend and a scale bar."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from companion.core.messages import FloorPlan
from companion.export.plan.turned import extent_m, main_direction_rad, turned

if TYPE_CHECKING:
    from companion.core.figures import Axes

PAPER = "#fbfaf7"
SIDE_MM, DPI = 203.2, 120
"""Side of the picture, mm, and dots per inch: 960 pixels. Chosen."""
AROUND_MM = 22.0
"""Margin around the plan for dimensions and scale bar, mm. Chosen."""


def draw(plan: FloorPlan, path: Path, unfinished: str = "") -> None:
    """Write a PNG of the plan with hits and path. Each flight of a joint map has its own colour.

    `unfinished`: why the mission was not completed; then the plan says so, and shows where it ends.
    """
    from companion.core.figures import own_style  # noqa: PLC0415 - slow to load, and only needed at the end

    with own_style():
        _draw(plan, path, unfinished)


def _draw(plan: FloorPlan, path: Path, unfinished: str) -> None:
    from companion.core.figures import Figure  # noqa: PLC0415
    from companion.export.plan import drawing, figure, unseen  # noqa: PLC0415

    plan = turned(plan, main_direction_rad(plan.walls))
    west_m, south_m, east_m, north_m = extent_m(plan, with_path=True)
    side_m = max(east_m - west_m, north_m - south_m, 1.0)
    m_per_mm = side_m / (SIDE_MM - 2 * AROUND_MM)
    picture = Figure(figsize=(SIDE_MM / figure.MM_PER_INCH,) * 2, dpi=DPI, facecolor=PAPER)
    axes = picture.add_axes((0, 0, 1, 1), facecolor=PAPER)
    axes.set_axis_off()
    half_m = side_m / 2 + AROUND_MM * m_per_mm
    middle_x_m, middle_y_m = (west_m + east_m) / 2, (south_m + north_m) / 2
    axes.set_xlim(middle_x_m - half_m, middle_x_m + half_m)
    axes.set_ylim(middle_y_m - half_m, middle_y_m + half_m)
    unseen_ne_m = unseen.unseen_borders(plan) if unfinished else ()
    shapes = drawing.draw(plan, (), (), drawing.Contents(), m_per_mm, unseen_ne_m=unseen_ne_m)
    figure.draw_in(axes, shapes, m_per_mm)
    if unfinished:
        figure.stamp(axes)
    _scale_bar(axes, m_per_mm, figure.INK)
    if plan.path or plan.walls:
        figure.legend(picture, shapes)
    picture.savefig(path, format="png")


def _scale_bar(axes: "Axes", m_per_mm: float, colour: str) -> None:
    (west_m, east_m), (south_m, _) = axes.get_xlim(), axes.get_ylim()
    bar_m = 10 ** math.floor(math.log10((east_m - west_m) / 2))
    left_m, base_m = west_m + 8 * m_per_mm, south_m + 8 * m_per_mm
    axes.plot([left_m, left_m + bar_m], [base_m, base_m], color=colour, linewidth=2)
    axes.text(left_m + bar_m / 2, base_m + 2.5 * m_per_mm, f"{bar_m:g} m", ha="center", fontsize=9)
