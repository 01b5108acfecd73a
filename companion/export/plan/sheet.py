"""Writes SVG and PDF: the floor plan as a drawing to scale on a sheet of paper.

The sheet has its true size, so that a ruler on the print measures lengths at the scale given.
"""

import math
import textwrap
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from companion.core.figures import Axes, Figure, Polygon, Text, own_style
from companion.core.frames import Vector2
from companion.export.plan.drawing import Contents, Drawing, draw
from companion.export.plan.figure import FAINT, INK, MM_PER_INCH, draw_in, stamp
from companion.export.plan.labels import Labels
from companion.export.plan.survey import Survey
from companion.export.plan.title import INCOMPLETE, MEASURED, Arrow, arrow, facts
from companion.export.plan.turned import extent_m
from companion.export.plan.unseen import unseen_borders

EDGE_MM = 10.0
"""Margin of the sheet, mm. Chosen."""
FOOT_MM = 24.0
"""Height of the title block at the bottom, mm. Chosen."""
WORDS_MM, ARROW_MM = 72.0, 20.0
"""The words of the title block begin this far from its left end, and leave so much to the arrow at
its right end, mm. Chosen."""
BAR_STEP_MM = 15.0
"""Longest of the four steps of the scale bar, mm. Chosen: the bar ends before the words."""
LINE_GAP_MM = 1.6
"""Space between the words of the title block, mm. Chosen."""
SLACK_LETTERS = 6
"""The first of two lines may be longer than half by this many letters. Chosen: a long word."""
AROUND_MM = 18.0
"""Margin around the plan for dimensions, mm. Chosen: the overall ones are 13.5 mm off it."""
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
            (self.width_mm - 2 * EDGE_MM) * self.m_per_mm,
            (self.height_mm - 2 * EDGE_MM - FOOT_MM) * self.m_per_mm,
        )

    @property
    def m_per_mm(self) -> float:
        """Metres for each millimetre of paper."""
        return self.scale / 1000

    @property
    def in_words(self) -> str:
        """Scale and paper."""
        return f"1 : {self.scale} on {self.paper}"

    def fits(self, east_m: float, north_m: float) -> bool:
        """True if a plan of this extent has room with its dimensions."""
        around_m = 2 * AROUND_MM * self.m_per_mm
        across_m, up_m = self.span_m
        return east_m + around_m <= across_m and north_m + around_m <= up_m


def write_svg(survey: Survey, path: Path, labels: Labels) -> None:
    """Write the sheet as SVG."""
    with own_style(SVG_IDS):
        metadata = {"Date": None, "Title": labels.title}
        sheet_figure(survey, labels).savefig(path, format="svg", metadata=metadata)


def write_pdf(survey: Survey, path: Path, labels: Labels) -> None:
    """Write the sheet as PDF."""
    with own_style():
        metadata = {"CreationDate": None, "Title": labels.title}
        sheet_figure(survey, labels).savefig(path, format="pdf", metadata=metadata)


def choose_sheet(survey: Survey, contents: Contents) -> Sheet:
    """Choose the largest scale that fits: A4 down to 1:100, else A3; landscape or portrait."""
    west_m, south_m, east_m, north_m = extent_m(survey.plan, with_path=contents.path)
    sheets = [
        Sheet(paper, *size, scale, 0.0, 0.0)
        for scale in SCALES
        for paper, long_mm, short_mm in PAPERS_MM
        for size in ((long_mm, short_mm), (short_mm, long_mm))
        if paper != "A4" or scale <= LARGEST_SCALE_ON_A4
    ]
    on_a4 = [sheet for sheet in sheets if sheet.paper == "A4"]
    wanted_m = east_m - west_m, north_m - south_m
    fitting = [sheet for sheet in (*on_a4, *sheets) if sheet.fits(*wanted_m)]
    sheet = fitting[0] if fitting else sheets[-1]
    east_span_m, north_span_m = sheet.span_m
    return replace(
        sheet,
        west_m=(west_m + east_m - east_span_m) / 2,
        south_m=(south_m + north_m - north_span_m) / 2,
    )


def turned_up(survey: Survey, labels: Labels) -> Survey:
    """The map as it stands on the paper."""
    return survey.turned(labels.up_rad(survey.plan))


def drawn(survey: Survey, labels: Labels, sheet: Sheet) -> Drawing:
    """The drawing of a map that is turned already."""
    unseen_ne_m = unseen_borders(survey.plan) if labels.unfinished else ()
    shown = survey.plan, survey.rooms, survey.openings, labels.contents
    return draw(*shown, sheet.m_per_mm, unseen_ne_m=unseen_ne_m)


def sheet_figure(survey: Survey, labels: Labels) -> Figure:
    """The sheet with the plan and the title block."""
    pointing = arrow(survey.plan, labels)
    survey = turned_up(survey, labels)
    sheet = choose_sheet(survey, labels.contents)
    figure = Figure(figsize=(sheet.width_mm / MM_PER_INCH, sheet.height_mm / MM_PER_INCH))
    plan = _axes(figure, sheet, EDGE_MM + FOOT_MM, sheet.height_mm - EDGE_MM)
    east_m, north_m = sheet.span_m
    plan.set_xlim(sheet.west_m, sheet.west_m + east_m)
    plan.set_ylim(sheet.south_m, sheet.south_m + north_m)
    draw_in(plan, drawn(survey, labels, sheet), sheet.m_per_mm)
    if labels.unfinished:
        stamp(plan)
    foot = _axes(figure, sheet, EDGE_MM, EDGE_MM + FOOT_MM)
    foot.set_xlim(0, sheet.width_mm - 2 * EDGE_MM)
    foot.set_ylim(0, FOOT_MM)
    _draw_foot(foot, survey, sheet, labels)
    _draw_arrow(foot, sheet.width_mm - 2 * EDGE_MM - 10, pointing)
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


def _draw_foot(axes: Axes, survey: Survey, sheet: Sheet, labels: Labels) -> None:
    """Draw scale bar, title and accuracy; coordinates in mm on paper."""
    width_mm = sheet.width_mm - 2 * EDGE_MM
    axes.plot([0, width_mm], [FOOT_MM - 1, FOOT_MM - 1], color=FAINT, linewidth=0.4)
    _draw_scale_bar(axes, sheet)
    notes = f"{MEASURED}; black: measured from both sides; grey: from one"
    if labels.unfinished:
        notes = f"{INCOMPLETE}: {labels.unfinished}; dashed red: nothing was seen beyond"
    top_mm = FOOT_MM - 4.5
    for words, style in (
        (labels.title, {"fontsize": 11, "color": INK, "weight": "bold"}),
        (facts(survey), {"fontsize": 8, "color": INK}),
        (notes, {"fontsize": 6.5, "color": FAINT}),
    ):
        top_mm -= LINE_GAP_MM + _write(axes, (WORDS_MM, top_mm), words, style)


def _write(axes: Axes, place_mm: Vector2, words: str, style: dict[str, Any]) -> float:
    """Write words below a place, up to the arrow; returns their height, mm.

    Longer words take two lines, and are smaller if that is not enough.
    """
    text = axes.text(*place_mm, words, va="top", **style)
    room_mm = axes.get_xlim()[1] - ARROW_MM - place_mm[0]
    if _size_mm(text)[0] > room_mm:
        text.set_text("\n".join(textwrap.wrap(words, math.ceil(len(words) / 2) + SLACK_LETTERS)))
    width_mm, _ = _size_mm(text)
    text.set_fontsize(style["fontsize"] * room_mm / max(room_mm, width_mm))
    return _size_mm(text)[1]


def _size_mm(text: Text) -> Vector2:
    """Width and height of a text on the paper, mm."""
    figure = text.get_figure()
    assert figure is not None
    box = text.get_window_extent()
    return box.width / figure.dpi * MM_PER_INCH, box.height / figure.dpi * MM_PER_INCH


def _draw_scale_bar(axes: Axes, sheet: Sheet) -> None:
    most_m = BAR_STEP_MM * sheet.m_per_mm
    power_m = 10.0 ** math.floor(math.log10(most_m))
    step_m = max(factor * power_m for factor in (1, 2, 5) if factor * power_m <= most_m)
    step_mm = step_m / sheet.m_per_mm
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
    axes.text(0, FOOT_MM - 19, sheet.in_words, fontsize=8, color=INK)


def _draw_arrow(axes: Axes, x_mm: float, pointing: Arrow) -> None:
    y_mm, half_mm = FOOT_MM - 9.5, 5.5
    heading_rad = pointing.heading_rad
    x_off_mm, y_off_mm = half_mm * math.sin(heading_rad), half_mm * math.cos(heading_rad)
    axes.annotate(
        "",
        (x_mm + x_off_mm, y_mm + y_off_mm),
        (x_mm - x_off_mm, y_mm - y_off_mm),
        arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 0.8},
    )
    axes.text(x_mm, FOOT_MM - 19, pointing.name, fontsize=6.5, ha="center", color=FAINT)
