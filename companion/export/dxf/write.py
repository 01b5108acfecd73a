"""Writes DXF for CAD: x right, y up on the paper, one drawing unit is one metre."""

import math
from pathlib import Path

from ezdxf.bbox import extents
from ezdxf.document import Drawing as Document
from ezdxf.entities.text import Text
from ezdxf.enums import TextEntityAlignment
from ezdxf.filemanagement import new
from ezdxf.layouts.layout import Modelspace
from ezdxf.math import Vec2
from ezdxf.units import M

from companion.export.dxf.blocks import DASHES, Title, define, insert_opening, insert_title
from companion.export.plan.dimensions import TEXT_MM, Dimension
from companion.export.plan.drawing import Area, Layer, Stroke
from companion.export.plan.labels import Labels
from companion.export.plan.sheet import choose_sheet, drawn, turned_up
from companion.export.plan.survey import Survey
from companion.export.plan.title import INCOMPLETE, MEASURED, arrow, facts

COLOURS = {
    Layer.ROOMS: 8,
    Layer.POINTS: 30,
    Layer.PATH: 4,
    Layer.UNSEEN: 1,
    Layer.BEHIND: 9,
    Layer.SOLID: 8,
    Layer.FURNITURE: 8,
    Layer.WALLS: 7,
    Layer.OPENINGS: 5,
    Layer.DIMENSIONS: 3,
    Layer.LABELS: 7,
    Layer.TITLE: 7,
}
"""AutoCAD's colour index of each layer."""
WEIGHTS = {Layer.WALLS: 50, Layer.FURNITURE: 18}
"""Line weights, 0.01 mm."""
WINDOW_ASPECT = 4 / 3
"""Width to height of the initial view. Chosen: most windows are wider."""
AROUND = 1.1
"""Height of the initial view, relative to what is drawn. Chosen."""
CAPITAL = 0.72
"""Height of capital letters by the font size, of common fonts."""
NOTE_MM = 5.0
"""Height of the note on an unfinished map, mm. Chosen."""
DASHES_MM = (2.0, 1.0)
"""Length of a dash and of a gap, mm. Chosen."""
BELOW_MM = 6.0
"""Distance of the title block from what is drawn, mm. Chosen."""
BY_LAYER = 256
"""AutoCAD's colour index for the layer's colour."""
LOWEST_VIEW_M = 5.0
"""Least height of the initial view, m. Chosen: an empty map has a title."""


def write_dxf(survey: Survey, path: Path, labels: Labels) -> None:
    """Write the plan, each kind of thing on its own layer."""
    pointing = arrow(survey.plan, labels)
    survey = turned_up(survey, labels)
    sheet = choose_sheet(survey, labels.contents)
    m_per_mm = sheet.m_per_mm
    drawing = drawn(survey, labels, sheet)
    document = _document(m_per_mm)
    space = document.modelspace()
    for area in drawing.areas:
        _area(space, area)
    for stroke in drawing.strokes:
        _stroke(space, stroke)
    for doorway in drawing.doorways:
        insert_opening(space, doorway)
    for dimension in drawing.dimensions:
        if any(dimension.off_xy_m):
            _dimension(space, dimension)
        else:
            _width(space, dimension, m_per_mm)
    for label in drawing.labels:
        text = _text(space, label.text, label.height_mm * m_per_mm, Layer.LABELS)
        text.set_placement(label.at_xy_m, align=TextEntityAlignment.MIDDLE_CENTER)
    for flown in drawing.paths_xy_m:
        if len(flown) > 1:
            space.add_lwpolyline(flown, dxfattribs={"layer": Layer.PATH})
    for point in drawing.points_xy_m:
        space.add_point(point, dxfattribs={"layer": Layer.POINTS})
    if labels.unfinished:
        _note(space, f"{INCOMPLETE}: {labels.unfinished}", m_per_mm)
    words = (labels.title, _plain(facts(survey)), MEASURED, sheet.in_words)
    below_m = _below(space, BELOW_MM * m_per_mm)
    insert_title(space, Title(*words, pointing), below_m, m_per_mm)
    _show(document)
    document.saveas(path)


def _note(space: Modelspace, text: str, m_per_mm: float) -> None:
    """Write a line below the drawing."""
    height_m = NOTE_MM * m_per_mm
    note = space.add_text(text, height=height_m, dxfattribs={"layer": Layer.LABELS})
    note.set_placement(_below(space, 2 * height_m))


def _below(space: Modelspace, off_m: float) -> Vec2:
    """A place below the left end of what is drawn."""
    drawn = extents(space, fast=True)
    low = drawn.extmin.vec2 if drawn.has_data else Vec2()
    return low - Vec2(0, off_m)


def _plain(text: str) -> str:
    """The text without a sign that fonts of CAD programs lack."""
    return text.replace("²", "2")


def _show(document: Document) -> None:
    """Set the initial view to the whole drawing; the default view is 1000 m high."""
    space = document.modelspace()
    drawn = extents(space, fast=True)
    low, high = drawn.extmin, drawn.extmax
    space.reset_extents(low, high)
    space.reset_limits(low.vec2, high.vec2)
    height_m = max(high.y - low.y, (high.x - low.x) / WINDOW_ASPECT, LOWEST_VIEW_M)
    document.set_modelspace_vport(
        AROUND * height_m, low.lerp(high).vec2, dxfattribs={"aspect_ratio": WINDOW_ASPECT}
    )


def _document(m_per_mm: float) -> Document:
    document = new("R2010", setup=True, units=M)
    document.header["$MEASUREMENT"] = 1
    document.header["$LTSCALE"] = m_per_mm
    document.linetypes.add(DASHES, (sum(DASHES_MM), DASHES_MM[0], -DASHES_MM[1]))
    for name, colour in COLOURS.items():
        weight = WEIGHTS.get(name, 13)
        line = DASHES if name is Layer.UNSEEN else "Continuous"
        document.layers.add(name, color=colour, lineweight=weight, linetype=line)
    document.layers.get(Layer.POINTS).off()
    define(document)
    style = document.dimstyles.duplicate_entry("EZDXF", "METRES")
    text_m = CAPITAL * TEXT_MM * m_per_mm
    style.dxf.dimtxt, style.dxf.dimasz = text_m, text_m / 2
    style.dxf.dimexe, style.dxf.dimexo, style.dxf.dimgap = text_m / 2, text_m / 2, text_m / 3
    style.dxf.dimdec, style.dxf.dimzin, style.dxf.dimlfac = 2, 0, 1.0
    style.dxf.dimpost = "<>"
    return document


def _area(space: Modelspace, area: Area) -> None:
    """A room is its outline; a part of a wall is filled."""
    layer = {"layer": area.layer}
    if area.layer is Layer.ROOMS:
        for ring in area.rings_xy_m:
            space.add_lwpolyline(ring, close=True, dxfattribs=layer)
        return
    hatch = space.add_hatch(color=BY_LAYER, dxfattribs=layer)
    for ring in area.rings_xy_m:
        hatch.paths.add_polyline_path(ring, is_closed=True)


def _stroke(space: Modelspace, stroke: Stroke) -> None:
    attributes = {"layer": stroke.layer}
    if stroke.layer is Layer.UNSEEN:
        space.add_lwpolyline(stroke.points_xy_m, dxfattribs=attributes)
    else:
        start, end = stroke.points_xy_m
        space.add_line(start, end, dxfattribs=attributes)


def _dimension(space: Modelspace, dimension: Dimension) -> None:
    """Draw a length in the direction of its text."""
    start, end = Vec2(dimension.start_xy_m), Vec2(dimension.end_xy_m)
    if (end - start).dot(Vec2.from_angle(dimension.angle_rad)) < 0:
        start, end = end, start
    off = Vec2(dimension.off_xy_m)
    is_left = (end - start).orthogonal().dot(off) > 0
    drawn = space.add_aligned_dim(
        p1=start,
        p2=end,
        distance=off.magnitude if is_left else -off.magnitude,
        dimstyle="METRES",
        dxfattribs={"layer": Layer.DIMENSIONS},
    )
    drawn.render()


def _width(space: Modelspace, dimension: Dimension, m_per_mm: float) -> None:
    """Write the width of an opening, which has no line."""
    text = _text(space, dimension.text, dimension.height_mm * m_per_mm, Layer.DIMENSIONS)
    text.dxf.rotation = math.degrees(dimension.angle_rad)
    text.set_placement(dimension.text_xy_m, align=TextEntityAlignment.MIDDLE_CENTER)


def _text(space: Modelspace, text: str, size_m: float, layer: Layer) -> Text:
    plain = _plain(text).replace("±", "%%p")
    return space.add_text(plain, height=CAPITAL * size_m, dxfattribs={"layer": layer})
