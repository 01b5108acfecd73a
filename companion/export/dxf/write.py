"""Writes DXF for CAD: x right, y up on the paper, one drawing unit is one metre."""

from pathlib import Path

from ezdxf.bbox import extents
from ezdxf.document import Drawing as Document
from ezdxf.enums import TextEntityAlignment
from ezdxf.filemanagement import new
from ezdxf.layouts.layout import Modelspace
from ezdxf.math import Vec2, Vec3
from ezdxf.units import M

from companion.core.frames import Vector2
from companion.export.plan.dimensions import TEXT_MM, Dimension
from companion.export.plan.drawing import Area, Layer, Stroke, draw
from companion.export.plan.labels import Labels
from companion.export.plan.sheet import INCOMPLETE, choose_sheet, turned_up
from companion.export.plan.survey import Survey

COLOURS = {
    Layer.ROOMS: 8,
    Layer.POINTS: 30,
    Layer.PATH: 4,
    Layer.BEHIND: 9,
    Layer.SOLID: 8,
    Layer.FURNITURE: 8,
    Layer.WALLS: 7,
    Layer.OPENINGS: 5,
    Layer.DIMENSIONS: 3,
    Layer.LABELS: 7,
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
BY_LAYER = 256
"""AutoCAD's colour index for the layer's colour."""
NOTHING_M = Vec3(5.0, 5.0, 0.0)
"""Upper right corner of the initial view of an empty map, m; the view is centred. Chosen."""


def write_dxf(survey: Survey, path: Path, labels: Labels) -> None:
    """Write the plan, each kind of thing on its own layer."""
    survey = turned_up(survey, labels)
    m_per_mm = choose_sheet(survey, labels.contents).m_per_mm
    drawing = draw(survey.plan, survey.rooms, survey.openings, labels.contents, m_per_mm)
    document = _document(m_per_mm)
    space = document.modelspace()
    for area in drawing.areas:
        _area(space, area)
    for stroke in drawing.strokes:
        _stroke(space, stroke)
    for dimension in drawing.dimensions:
        _dimension(space, dimension)
    for label in drawing.labels:
        _text(space, label.text.replace("²", "2"), label.at_xy_m, label.height_mm * m_per_mm)
    for flown in drawing.paths_xy_m:
        if len(flown) > 1:
            space.add_lwpolyline(flown, dxfattribs={"layer": Layer.PATH})
    for point in drawing.points_xy_m:
        space.add_point(point, dxfattribs={"layer": Layer.POINTS})
    if labels.unfinished:
        _note(space, f"{INCOMPLETE}: {labels.unfinished}", m_per_mm)
    _show(document)
    document.saveas(path)


def _note(space: Modelspace, text: str, m_per_mm: float) -> None:
    """Write a line below the drawing."""
    drawn = extents(space, fast=True)
    low = drawn.extmin if drawn.has_data else -NOTHING_M
    height_m = NOTE_MM * m_per_mm
    note = space.add_text(text, height=height_m, dxfattribs={"layer": Layer.LABELS})
    note.set_placement((low.x, low.y - 2 * height_m))


def _show(document: Document) -> None:
    """Set the initial view to the whole drawing; the default view is 1000 m high."""
    space = document.modelspace()
    drawn = extents(space, fast=True)
    low, high = (drawn.extmin, drawn.extmax) if drawn.has_data else (-NOTHING_M, NOTHING_M)
    space.reset_extents(low, high)
    space.reset_limits(low.vec2, high.vec2)
    height_m = max(high.y - low.y, (high.x - low.x) / WINDOW_ASPECT)
    document.set_modelspace_vport(
        AROUND * height_m, low.lerp(high).vec2, dxfattribs={"aspect_ratio": WINDOW_ASPECT}
    )


def _document(m_per_mm: float) -> Document:
    document = new("R2010", setup=True, units=M)
    document.header["$MEASUREMENT"] = 1
    for name, colour in COLOURS.items():
        weight = WEIGHTS.get(name, 13)
        document.layers.add(name, color=colour, lineweight=weight)
    document.layers.get(Layer.POINTS).off()
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
    attributes: dict[str, str] = {"layer": stroke.layer}
    if stroke.layer is Layer.OPENINGS:
        attributes["linetype"] = "DASHED"
    start, end = stroke.points_xy_m
    space.add_line(start, end, dxfattribs=attributes)


def _dimension(space: Modelspace, dimension: Dimension) -> None:
    """Draw a length, from left to right for readability."""
    start, end = sorted(
        (Vec2(dimension.start_xy_m), Vec2(dimension.end_xy_m)),
        key=lambda point: (round(point.x, 3), point.y),
    )
    off = Vec2(dimension.off_xy_m)
    is_left = (end - start).orthogonal().dot(off) > 0
    drawn = space.add_aligned_dim(
        p1=start,
        p2=end,
        distance=off.magnitude if is_left else -off.magnitude,
        text="<>" if off else dimension.text.replace("±", "%%p"),
        dimstyle="METRES",
        dxfattribs={"layer": Layer.DIMENSIONS},
    )
    drawn.render()


def _text(space: Modelspace, text: str, place: Vector2, size_m: float) -> None:
    label = space.add_text(text, height=CAPITAL * size_m, dxfattribs={"layer": Layer.LABELS})
    label.set_placement(place, align=TextEntityAlignment.MIDDLE_CENTER)
