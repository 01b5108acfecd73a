"""Writes GeoJSON for GIS programs: longitude and latitude in degrees (RFC 7946).

The map is relative to the take-off point and the first heading. The caller passes the geographic
position and true heading of take-off as a `Place`.
"""

import json
from collections.abc import Sequence
from pathlib import Path

from shapely.geometry.polygon import orient

from companion.core.errors import OutputError
from companion.core.frames import Place, Vector2
from companion.export.plan.survey import Room, Survey

NOWHERE = (
    "the place of take-off on Earth is not known; give --lat-deg and --lon-deg, or set "
    "link.origin_lat_deg and link.origin_lon_deg"
)
"""Error without a place, with the remedy."""
DIGITS = 9
"""Decimal places of a degree: a resolution of 0.1 mm."""


def write_geojson(survey: Survey, path: Path, place: Place | None) -> None:
    """Write rooms as polygons, and walls, openings and the path as lines.

    The property `kind` is "room", "wall", "opening" or "path".

    Raises:
        OutputError: the place of take-off on Earth is not known.
    """
    if place is None:
        raise OutputError(f"{path}: {NOWHERE}")

    def position(point_ne_m: Vector2) -> tuple[float, ...]:
        return tuple(round(degrees, DIGITS) for degrees in place.lon_lat_deg(*point_ne_m))

    def line(points_ne_m: Sequence[Vector2], kind: str, **properties: object) -> dict[str, object]:
        coordinates = [position(point) for point in points_ne_m]
        geometry = {"type": "LineString", "coordinates": coordinates}
        return _feature(geometry, kind, properties)

    def area(room: Room) -> dict[str, object]:
        outlines = orient(room.polygon)  # RFC 7946: anticlockwise, holes clockwise
        rings = [
            [position((north, east)) for east, north in ring.coords]
            for ring in (outlines.exterior, *outlines.interiors)
        ]
        properties = {"name": room.name, "area_m2": round(room.area_m2, 3)}
        return _feature({"type": "Polygon", "coordinates": rings}, "room", properties)

    plan = survey.plan
    features = [area(room) for room in survey.rooms]
    features += [
        line(
            [wall.start_ne_m, wall.end_ne_m],
            "wall",
            length_m=round(wall.length_m, 4),
            sigma_m=round(wall.sigma_m, 4),
        )
        for wall in plan.walls
    ]
    features += [
        line(
            [gap.start_ne_m, gap.end_ne_m],
            "opening",
            width_m=round(gap.width_m, 4),
            sigma_m=round(gap.sigma_m, 4),
        )
        for gap in survey.openings
    ]
    features += [
        line([pose.ne_m for pose in path_flown], "path")
        for path_flown in plan.paths
        if len(path_flown) > 1
    ]
    path.write_text(
        json.dumps({"type": "FeatureCollection", "features": features}) + "\n", encoding="utf-8"
    )


def _feature(geometry: object, kind: str, properties: dict[str, object]) -> dict[str, object]:
    return {"type": "Feature", "geometry": geometry, "properties": {"kind": kind, **properties}}
