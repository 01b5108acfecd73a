"""Draws the shapes of a plan into axes whose unit is the metre, for SVG, PDF and PNG."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.core.figures import Axes, Figure, Outline, PathPatch
from companion.core.frames import Vector2
from companion.export.colours import flight_colour
from companion.export.plan.dimensions import Dimension
from companion.export.plan.drawing import Area, Drawing, Layer, Stroke
from companion.export.plan.title import INCOMPLETE

INK, FAINT, RETURNS, DOOR, WARNING = "#1d2b33", "#6b7a83", "#e07a1f", "#2a9d8f", "#c1121f"
MM_PER_INCH = 25.4
"""Millimetres per inch, exact by definition."""
PT_PER_MM = 72 / MM_PER_INCH
"""Points per millimetre, exact by definition."""
FINE_PT, PATH_PT, RETURNS_PT = 0.4, 0.7, 0.9
"""Widths of dimension lines and paths, and diameter of a beam's end, points. Chosen."""
STAMP_PT = 54
"""Height of the stamp on an unfinished map, points. Chosen."""
TICK_MM = 1.0
"""Half length of the ticks at the ends of a dimension line, mm. Chosen."""


@dataclass(frozen=True, slots=True)
class _Pen:
    colour: str
    width_pt: float
    dashes: str = "-"


PENS = {
    Layer.WALLS: _Pen(INK, 2.0),
    Layer.FURNITURE: _Pen(FAINT, 0.8),
    Layer.UNSEEN: _Pen(WARNING, 1.2, "--"),
    Layer.OPENINGS: _Pen(DOOR, 1.2, "--"),
}
NAMES = {
    Layer.WALLS: "walls",
    Layer.SOLID: "measured from both sides",
    Layer.BEHIND: "from one side",
    Layer.FURNITURE: "furniture",
    Layer.UNSEEN: "nothing seen beyond",
}
"""Layers in the legend."""
FILLS = {Layer.ROOMS: "#f1efe8", Layer.BEHIND: "#b9c2c7", Layer.SOLID: INK}


def draw_in(axes: Axes, drawing: Drawing, m_per_mm: float) -> None:
    """Draw all shapes. `m_per_mm`: metres for each millimetre of paper."""
    for area in drawing.areas:
        _fill(axes, area)
    axes.scatter(
        [x for x, _ in drawing.points_xy_m],
        [y for _, y in drawing.points_xy_m],
        s=RETURNS_PT**2,
        color=RETURNS,
        linewidths=0,
        alpha=0.5,
        rasterized=True,
    )
    for number, path in enumerate(drawing.paths_xy_m):
        _line(axes, path, _Pen(flight_colour(number), PATH_PT))
    if drawing.paths_xy_m:
        axes.plot(0, 0, marker="o", markersize=3.5, color=flight_colour(0))
    for stroke in drawing.strokes:
        _stroke(axes, stroke)
    for doorway in drawing.doorways:
        _line(axes, (doorway.start_xy_m, doorway.end_xy_m), PENS[Layer.OPENINGS])
    for dimension in drawing.dimensions:
        _dimension(axes, dimension, m_per_mm)
    for label in drawing.labels:
        _text(axes, label.text, label.at_xy_m, label.height_mm)


def stamp(axes: Axes) -> None:
    """Write across the plan that it is not finished."""
    axes.text(
        0.5,
        0.5,
        INCOMPLETE,
        transform=axes.transAxes,
        rotation=30,
        ha="center",
        va="center",
        fontsize=STAMP_PT,
        color=WARNING,
        alpha=0.25,
        weight="bold",
    )


def legend(figure: Figure, drawing: Drawing) -> None:
    """Name what is drawn, below the plan."""
    (axes,) = figure.axes
    nothing: list[float] = []
    if drawing.points_xy_m:
        axes.plot(nothing, nothing, ".", color=RETURNS, label="range returns")
    paths = drawing.paths_xy_m
    for number in range(len(paths)):
        name = "path flown" if len(paths) == 1 else f"flight {number + 1}"
        axes.plot(nothing, nothing, color=flight_colour(number), label=name)
    drawn = {each.layer for each in drawing.strokes} | {each.layer for each in drawing.areas}
    for layer, name in NAMES.items():
        if layer in drawn:
            pen = PENS.get(layer) or _Pen(FILLS[layer], 6.0)
            axes.plot(
                nothing,
                nothing,
                color=pen.colour,
                linewidth=pen.width_pt,
                linestyle=pen.dashes,
                label=name,
            )
    figure.legend(
        loc="lower center", ncols=7, frameon=False, fontsize=8, columnspacing=1.0, handlelength=1.5
    )


def _fill(axes: Axes, area: Area) -> None:
    rings = [Outline([*ring, ring[0]], closed=True) for ring in area.rings_xy_m]
    outline = Outline.make_compound_path(*rings)
    axes.add_patch(PathPatch(outline, facecolor=FILLS[area.layer], edgecolor="none", zorder=0.5))


def _stroke(axes: Axes, stroke: Stroke) -> None:
    _line(axes, stroke.points_xy_m, PENS[stroke.layer])


def _line(axes: Axes, points_xy_m: Sequence[Vector2], pen: _Pen) -> None:
    axes.plot(
        [x for x, _ in points_xy_m],
        [y for _, y in points_xy_m],
        color=pen.colour,
        linewidth=pen.width_pt,
        linestyle=pen.dashes,
        solid_capstyle="projecting",
    )


def _dimension(axes: Axes, dimension: Dimension, m_per_mm: float) -> None:
    """The line with ticks at its ends, and the length."""
    off_x_m, off_y_m = dimension.off_xy_m
    off_m = math.hypot(off_x_m, off_y_m)
    if off_m:
        ends = [(x + off_x_m, y + off_y_m) for x, y in (dimension.start_xy_m, dimension.end_xy_m)]
        _line(axes, ends, _Pen(FAINT, FINE_PT))
        tick_m = TICK_MM * m_per_mm
        tick_x_m, tick_y_m = (tick_m * each / off_m for each in (off_x_m, off_y_m))
        for x, y in ends:
            tick = (x - tick_x_m, y - tick_y_m), (x + tick_x_m, y + tick_y_m)
            _line(axes, tick, _Pen(FAINT, FINE_PT))
    _text(
        axes,
        dimension.text,
        dimension.text_xy_m,
        dimension.height_mm,
        colour=INK if off_m else DOOR,
        angle_rad=dimension.angle_rad,
    )


def _text(
    axes: Axes,
    text: str,
    at_xy_m: Vector2,
    height_mm: float,
    *,
    colour: str = INK,
    angle_rad: float = 0.0,
) -> None:
    axes.text(
        *at_xy_m,
        text,
        ha="center",
        va="center",
        fontsize=height_mm * PT_PER_MM,
        color=colour,
        rotation=math.degrees(angle_rad),
    )
