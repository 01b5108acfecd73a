"""Writes DXF for CAD: x east, y north, one drawing unit is one metre."""

from pathlib import Path

from ezdxf.bbox import extents
from ezdxf.document import Drawing
from ezdxf.enums import TextEntityAlignment
from ezdxf.filemanagement import new
from ezdxf.layouts.layout import Modelspace
from ezdxf.math import Vec2, Vec3
from ezdxf.units import M

from companion.core.frames import Vector2
from companion.export.plan.dimensions import MIN_LENGTH_M, OFF_M, dimension_side_ne
from companion.export.plan.survey import Survey

LAYERS = {"WALLS": 7, "OPENINGS": 5, "ROOMS": 8, "LABELS": 7, "DIMENSIONS": 3, "PATH": 4}
"""Layer names and their AutoCAD colour indices."""
TEXT_M = 0.18
"""Text height, m. Chosen."""
WINDOW_ASPECT = 4 / 3
"""Width to height of the initial view. Chosen: most windows are wider."""
AROUND = 1.1
"""Height of the initial view, relative to what is drawn. Chosen."""
NOTHING_M = Vec3(5.0, 5.0, 0.0)
"""Upper right corner of the initial view of an empty map, m; the view is centred. Chosen."""


def write_dxf(survey: Survey, path: Path) -> None:
    """Write walls, openings, rooms, labels, dimensions and path, each on its own layer."""
    document = _document()
    space = document.modelspace()
    for wall in survey.plan.walls:
        start, end = _xy(wall.start_ne_m), _xy(wall.end_ne_m)
        space.add_line(start, end, dxfattribs={"layer": "WALLS", "lineweight": 50})
        if wall.length_m >= MIN_LENGTH_M:
            _dimension(space, start, end, _xy(dimension_side_ne(survey, wall)))
    for opening in survey.openings:
        start, end = _xy(opening.start_ne_m), _xy(opening.end_ne_m)
        space.add_line(start, end, dxfattribs={"layer": "OPENINGS", "linetype": "DASHED"})
        _dimension(space, start, end, (end - start).orthogonal())
    for room in survey.rooms:
        for ring in (room.outline_ne_m, *room.holes_ne_m):
            outline = [_xy(corner) for corner in ring]
            space.add_lwpolyline(outline, close=True, dxfattribs={"layer": "ROOMS"})
        _label(space, room.name, _xy(room.label_ne_m) + Vec2(0, TEXT_M))
        _label(space, f"{room.area_m2:.2f} m2", _xy(room.label_ne_m) - Vec2(0, TEXT_M))
    for path_flown in survey.plan.paths:
        if len(path_flown) > 1:
            flown = [Vec2(pose.east_m, pose.north_m) for pose in path_flown]
            space.add_lwpolyline(flown, dxfattribs={"layer": "PATH"})
    _show(document)
    document.saveas(path)


def _show(document: Drawing) -> None:
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


def _document() -> Drawing:
    document = new("R2010", setup=True, units=M)
    document.header["$MEASUREMENT"] = 1
    for name, colour in LAYERS.items():
        document.layers.add(name, color=colour)
    style = document.dimstyles.duplicate_entry("EZDXF", "METRES")
    style.dxf.dimtxt, style.dxf.dimasz = TEXT_M, TEXT_M / 2
    style.dxf.dimexe, style.dxf.dimexo, style.dxf.dimgap = TEXT_M / 2, TEXT_M / 2, TEXT_M / 3
    style.dxf.dimdec, style.dxf.dimzin, style.dxf.dimlfac = 2, 0, 1.0
    style.dxf.dimpost = "<> m"
    return document


def _dimension(space: Modelspace, start: Vec2, end: Vec2, side: Vec2) -> None:
    """Draw the line's length on the given side, from left to right for readability."""
    start, end = sorted((start, end), key=lambda point: (round(point.x, 3), point.y))
    is_left = (end - start).orthogonal().dot(side) > 0
    dimension = space.add_aligned_dim(
        p1=start,
        p2=end,
        distance=OFF_M if is_left else -OFF_M,
        dimstyle="METRES",
        dxfattribs={"layer": "DIMENSIONS"},
    )
    dimension.render()


def _label(space: Modelspace, text: str, place: Vec2) -> None:
    label = space.add_text(text, height=TEXT_M, dxfattribs={"layer": "LABELS"})
    label.set_placement(place, align=TextEntityAlignment.MIDDLE_CENTER)


def _xy(point_ne_m: Vector2) -> Vec2:
    return Vec2(point_ne_m[1], point_ne_m[0])
