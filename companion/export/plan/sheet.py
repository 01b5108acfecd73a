"""Writes SVG and PDF: the floor plan as a drawing to scale on a sheet of paper.

East is right; north, the drone's first heading, is up. The sheet has its true size, so that a ruler
on the print measures lengths at the scale given.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from companion.core.figures import Axes, Figure, Outline, PathPatch, Polygon, rc_context
from companion.core.frames import Vector2
from companion.core.messages import WallSegment
from companion.export.plan.dimensions import MIN_LENGTH_M, OFF_M, dimension_side_ne
from companion.export.plan.survey import Opening, Room, Survey

INK, FAINT, PATH, RETURNS, ROOM, DOOR = (
    "#1d2b33",
    "#6b7a83",
    "#3a86c8",
    "#e07a1f",
    "#f1efe8",
    "#2a9d8f",
)
MM_PER_INCH = 25.4
"""Millimetres per inch, exact by definition."""
EDGE_MM = 10.0
"""Margin of the sheet, mm. Chosen."""
FOOT_MM = 24.0
"""Height of the title block at the bottom, mm. Chosen."""
AROUND_M = 1.0
"""Margin around the plan for dimensions, m. Chosen."""
SCALES = (20, 25, 50, 100, 200, 250, 500, 1000, 2000)
"""Denominators of the available scales. Chosen."""
PAPERS_MM = (("A4", 297.0, 210.0), ("A3", 420.0, 297.0))
"""Name, long side and short side (ISO 216), mm."""
LARGEST_SCALE_ON_A4 = 100
"""Largest denominator on A4; smaller scales use A3. Chosen."""
SVG_IDS: Any = {"svg.hashsalt": "plan", "svg.fonttype": "none", "text.parse_math": False}
"""Settings for a reproducible file with text as text; a $ starts no formula."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """A sheet of paper and the part of the map on it."""

    paper: str
    width_mm: float
    height_mm: float
    scale: int
    """Denominator of the scale 1 : scale."""
    west_m: float
    south_m: float

    @property
    def span_m(self) -> tuple[float, float]:
        """Extent of the drawing area, (east, north), m."""
        return (
            (self.width_mm - 2 * EDGE_MM) * self.scale / 1000,
            (self.height_mm - 2 * EDGE_MM - FOOT_MM) * self.scale / 1000,
        )


def write_svg(survey: Survey, path: Path, title: str) -> None:
    """Write the sheet as SVG."""
    with rc_context(SVG_IDS):
        _draw(survey, title).savefig(path, format="svg", metadata={"Date": None, "Title": title})


def write_pdf(survey: Survey, path: Path, title: str) -> None:
    """Write the sheet as PDF."""
    _draw(survey, title).savefig(
        path, format="pdf", metadata={"CreationDate": None, "Title": title}
    )


def choose_sheet(survey: Survey) -> Sheet:
    """Choose the largest scale that fits: A4 down to 1:100, else A3; landscape or portrait."""
    corners = [end for wall in survey.plan.walls for end in (wall.start_ne_m, wall.end_ne_m)]
    corners += [pose.ne_m for pose in survey.plan.path] or [(0.0, 0.0)]
    south_m, north_m = min(n for n, _ in corners), max(n for n, _ in corners)
    west_m, east_m = min(e for _, e in corners), max(e for _, e in corners)
    wanted_m = east_m - west_m + 2 * AROUND_M, north_m - south_m + 2 * AROUND_M
    sheets = [
        Sheet(paper, *size, scale, 0.0, 0.0)
        for scale in SCALES
        for paper, long_mm, short_mm in PAPERS_MM
        for size in ((long_mm, short_mm), (short_mm, long_mm))
        if paper != "A4" or scale <= LARGEST_SCALE_ON_A4
    ]
    on_a4 = [sheet for sheet in sheets if sheet.paper == "A4"]
    fitting = [
        sheet
        for sheet in (*on_a4, *sheets)
        if all(span >= want for span, want in zip(sheet.span_m, wanted_m, strict=True))
    ]
    sheet = fitting[0] if fitting else sheets[-1]
    east_span_m, north_span_m = sheet.span_m
    return Sheet(
        sheet.paper,
        sheet.width_mm,
        sheet.height_mm,
        sheet.scale,
        (west_m + east_m - east_span_m) / 2,
        (south_m + north_m - north_span_m) / 2,
    )


def _draw(survey: Survey, title: str) -> Figure:
    sheet = choose_sheet(survey)
    figure = Figure(figsize=(sheet.width_mm / MM_PER_INCH, sheet.height_mm / MM_PER_INCH))
    plan = _axes(figure, sheet, EDGE_MM + FOOT_MM, sheet.height_mm - EDGE_MM)
    east_m, north_m = sheet.span_m
    plan.set_xlim(sheet.west_m, sheet.west_m + east_m)
    plan.set_ylim(sheet.south_m, sheet.south_m + north_m)
    _draw_plan(plan, survey, sheet)
    foot = _axes(figure, sheet, EDGE_MM, EDGE_MM + FOOT_MM)
    foot.set_xlim(0, sheet.width_mm - 2 * EDGE_MM)
    foot.set_ylim(0, FOOT_MM)
    _draw_foot(foot, survey, sheet, title)
    return figure


def _axes(figure: Figure, sheet: Sheet, low_mm: float, high_mm: float) -> Axes:
    """Axes over the full width between two heights from the bottom of the sheet, mm."""
    axes = figure.add_axes(
        (
            EDGE_MM / sheet.width_mm,
            low_mm / sheet.height_mm,
            1 - 2 * EDGE_MM / sheet.width_mm,
            (high_mm - low_mm) / sheet.height_mm,
        )
    )
    axes.set_axis_off()
    return axes


def _draw_plan(axes: Axes, survey: Survey, sheet: Sheet) -> None:
    plan = survey.plan
    for room in survey.rooms:
        _draw_room(axes, room)
    axes.scatter(
        [hit.position_ned_m[1] for hit in plan.hits],
        [hit.position_ned_m[0] for hit in plan.hits],
        s=0.8,
        color=RETURNS,
        linewidths=0,
        alpha=0.5,
        rasterized=True,
    )
    for path_flown in plan.paths:
        axes.plot(
            [pose.east_m for pose in path_flown],
            [pose.north_m for pose in path_flown],
            color=PATH,
            linewidth=0.7,
        )
    if plan.path:
        axes.plot(0, 0, marker="o", markersize=3.5, color=PATH)
    for wall in plan.walls:
        _draw_line(axes, wall.start_ne_m, wall.end_ne_m, INK, 2.0)
        if wall.length_m >= MIN_LENGTH_M:
            _draw_dimension(axes, survey, wall, sheet)
    for opening in survey.openings:
        _draw_opening(axes, opening)
    for room in survey.rooms:
        _label_room(axes, room)


def _draw_room(axes: Axes, room: Room) -> None:
    rings = [room.outline_ne_m, *room.holes_ne_m]
    outline = Outline.make_compound_path(
        *(Outline([(e, n) for n, e in [*ring, ring[0]]], closed=True) for ring in rings)
    )
    axes.add_patch(PathPatch(outline, facecolor=ROOM, edgecolor="none", zorder=0))


def _label_room(axes: Axes, room: Room) -> None:
    north, east = room.label_ne_m
    text = f"{room.name}\n{room.area_m2:.1f} m²"
    axes.text(east, north, text, ha="center", va="center", fontsize=9, color=INK, linespacing=1.4)


def _draw_line(axes: Axes, start: Vector2, end: Vector2, colour: str, width: float) -> None:
    axes.plot(
        [start[1], end[1]],
        [start[0], end[0]],
        color=colour,
        linewidth=width,
        solid_capstyle="projecting",
    )


def _draw_opening(axes: Axes, opening: Opening) -> None:
    (north_a, east_a), (north_b, east_b) = opening.start_ne_m, opening.end_ne_m
    axes.plot([east_a, east_b], [north_a, north_b], color=DOOR, linewidth=1.2, linestyle="--")
    off = OFF_M / opening.width_m
    axes.text(
        (east_a + east_b) / 2 + off * (north_b - north_a),
        (north_a + north_b) / 2 - off * (east_b - east_a),
        f"{opening.width_m:.2f}",
        ha="center",
        va="center",
        fontsize=6,
        color=DOOR,
    )


def _draw_dimension(axes: Axes, survey: Survey, wall: WallSegment, sheet: Sheet) -> None:
    """Draw a line with ticks beside the wall, and the wall's length."""
    (north_a, east_a), (north_b, east_b) = wall.start_ne_m, wall.end_ne_m
    side = dimension_side_ne(survey, wall)
    off_m = OFF_M * max(1.0, sheet.scale / 100)
    shift = side[0] * off_m, side[1] * off_m
    ends = (north_a + shift[0], east_a + shift[1]), (north_b + shift[0], east_b + shift[1])
    _draw_line(axes, *ends, FAINT, 0.4)
    for north, east in ends:
        tick = 0.25 * shift[0], 0.25 * shift[1]
        _draw_line(
            axes, (north - tick[0], east - tick[1]), (north + tick[0], east + tick[1]), FAINT, 0.4
        )
    angle_deg = math.degrees(math.atan2(north_b - north_a, east_b - east_a))
    axes.text(
        (east_a + east_b) / 2 + 1.6 * shift[1],
        (north_a + north_b) / 2 + 1.6 * shift[0],
        f"{wall.length_m:.2f}",
        rotation=(angle_deg + 90) % 180 - 90,
        ha="center",
        va="center",
        fontsize=7,
        color=INK,
    )


def _draw_foot(axes: Axes, survey: Survey, sheet: Sheet, title: str) -> None:
    """Draw scale bar, title and accuracy; coordinates in mm on paper."""
    width_mm = sheet.width_mm - 2 * EDGE_MM
    axes.plot([0, width_mm], [FOOT_MM - 1, FOOT_MM - 1], color=FAINT, linewidth=0.4)
    _draw_scale_bar(axes, sheet)
    plan = survey.plan
    area_m2 = sum(room.area_m2 for room in survey.rooms)
    length_m = sum(wall.length_m for wall in plan.walls)
    sigma_m = sum(wall.length_m * wall.sigma_m for wall in plan.walls) / (length_m or 1.0)
    ceiling = "" if plan.ceiling_m is None else f", ceiling {plan.ceiling_m:.2f} m"
    facts = (
        f"{len(survey.rooms)} room{'' if len(survey.rooms) == 1 else 's'}, {area_m2:.1f} m²; "
        f"{length_m:.1f} m of wall, ± {100 * sigma_m:.1f} cm (1 σ){ceiling}"
    )
    notes = "metres; wall surfaces as measured; up is the drone's heading at take-off"
    left_mm = 72.0
    axes.text(left_mm, FOOT_MM - 7, title, fontsize=11, color=INK, weight="bold", va="center")
    axes.text(left_mm, FOOT_MM - 13, facts, fontsize=8, color=INK, va="center")
    axes.text(left_mm, FOOT_MM - 18, notes, fontsize=6.5, color=FAINT, va="center")
    _draw_north(axes, width_mm - 6)


def _draw_scale_bar(axes: Axes, sheet: Sheet) -> None:
    step_m = 10 ** math.floor(math.log10(50 * sheet.scale / 1000))
    step_m *= 2 if 4 * step_m * 1000 / sheet.scale < 25 else 1
    step_mm = 1000 * step_m / sheet.scale
    for number in range(4):
        corners = [
            (number * step_mm, FOOT_MM - 10),
            ((number + 1) * step_mm, FOOT_MM - 10),
            ((number + 1) * step_mm, FOOT_MM - 8),
            (number * step_mm, FOOT_MM - 8),
        ]
        fill = INK if number % 2 == 0 else "white"
        axes.add_patch(Polygon(corners, facecolor=fill, edgecolor=INK, linewidth=0.5))
    for number in (0, 1, 2, 4):
        label = f"{number * step_m:g}" + (" m" if number == 4 else "")
        axes.text(number * step_mm, FOOT_MM - 13, label, fontsize=7, ha="center", color=INK)
    axes.text(0, FOOT_MM - 19, f"1 : {sheet.scale} on {sheet.paper}", fontsize=8, color=INK)


def _draw_north(axes: Axes, x_mm: float) -> None:
    axes.annotate(
        "",
        (x_mm, FOOT_MM - 3.5),
        (x_mm, FOOT_MM - 15),
        arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 0.8},
    )
    axes.text(x_mm, FOOT_MM - 19, "heading", fontsize=6.5, ha="center", color=FAINT)
