"""Draws the floor plan as a PNG image, with its main walls upright, a legend and a scale bar."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from companion.core.messages import FloorPlan

if TYPE_CHECKING:
    from companion.core.figures import Axes

PAPER = "#fbfaf7"
SIDE_MM, DPI = 203.2, 120
"""Side of the picture, mm, and dots per inch: 960 pixels. Chosen."""
AROUND_MM = 22.0
"""Margin around the plan for dimensions and scale bar, mm. Chosen."""
MM_PER_INCH = 25.4
"""Millimetres per inch, exact by definition."""


def draw(plan: FloorPlan, path: Path) -> None:
    """Write a PNG of the plan with hits and path. Each flight of a joint map has its own colour."""
    from companion.core.figures import Figure  # noqa: PLC0415 - slow to load, and only needed at the end
    from companion.export.plan import drawing, figure  # noqa: PLC0415
    from companion.export.plan.turned import main_direction_rad, turned  # noqa: PLC0415

    plan = turned(plan, main_direction_rad(plan.walls))
    west_m, east_m, south_m, north_m = _extent_m(plan)
    side_m = max(east_m - west_m, north_m - south_m, 1.0)
    m_per_mm = side_m / (SIDE_MM - 2 * AROUND_MM)
    picture = Figure(figsize=(SIDE_MM / MM_PER_INCH,) * 2, dpi=DPI, facecolor=PAPER)
    axes = picture.add_axes((0, 0, 1, 1), facecolor=PAPER)
    axes.set_axis_off()
    half_m = side_m / 2 + AROUND_MM * m_per_mm
    middle_x_m, middle_y_m = (west_m + east_m) / 2, (south_m + north_m) / 2
    axes.set_xlim(middle_x_m - half_m, middle_x_m + half_m)
    axes.set_ylim(middle_y_m - half_m, middle_y_m + half_m)
    shapes = drawing.draw(plan, (), (), drawing.Contents(), m_per_mm)
    figure.draw_in(axes, shapes, m_per_mm)
    _scale_bar(axes, m_per_mm)
    if plan.path or plan.walls:
        figure.legend(picture, shapes)
    picture.savefig(path, format="png")


def _extent_m(plan: FloorPlan) -> tuple[float, float, float, float]:
    """West, east, south and north edge of walls and path, m."""
    corners = [end for wall in plan.walls for end in (wall.start_ne_m, wall.end_ne_m)]
    corners += [pose.ne_m for pose in plan.path] or [(0.0, 0.0)]
    north_m, east_m = zip(*corners, strict=True)
    return min(east_m), max(east_m), min(north_m), max(north_m)


def _scale_bar(axes: "Axes", m_per_mm: float) -> None:
    (west_m, east_m), (south_m, _) = axes.get_xlim(), axes.get_ylim()
    bar_m = 10 ** math.floor(math.log10((east_m - west_m) / 2))
    left_m, base_m = west_m + 8 * m_per_mm, south_m + 8 * m_per_mm
    axes.plot([left_m, left_m + bar_m], [base_m, base_m], color="#1d2b33", linewidth=2)
    axes.text(left_m + bar_m / 2, base_m + 2.5 * m_per_mm, f"{bar_m:g} m", ha="center", fontsize=9)
