"""Writes IFC 4 for BIM programs: walls, openings, spaces and one storey.

What the drone has not measured is nominal, and a property of the object says so: the thickness of a
wall that was seen from one side, and the height of an opening.
"""

from dataclasses import dataclass
from pathlib import Path

import ifcopenshell.api.feature

from companion.export.ifc.model import Entity, Model
from companion.export.ifc.walls import Doorway, Wall, walls
from companion.export.plan.building import building
from companion.export.plan.dimensions import SIGMAS
from companion.export.plan.labels import Labels
from companion.export.plan.sheet import turned_up
from companion.export.plan.survey import Room, Survey
from companion.export.plan.title import INCOMPLETE, facts
from companion.export.plan.turned import to_xy

DOORWAY_M = 2.0
"""Nominal height of an opening, m. Chosen: the drone does not see the head of a door."""
LINTEL_M = 0.1
"""An opening that leaves less than this below the ceiling reaches up to it, m. Chosen."""
BEYOND_M = 0.05
"""The body of an opening exceeds its wall by this on both sides, m. Chosen: programs subtract
bodies with a common surface badly."""
SECONDS, MILLIONTHS = 3600, 1_000_000
"""Seconds of a degree, and the least unit of a place on Earth in IFC, by definition."""


@dataclass(frozen=True, slots=True)
class _Storey:
    """The storey that all objects are in."""

    model: Model
    entity: Entity
    height_m: float
    """Height of its walls."""
    is_height_measured: bool


def write_ifc(survey: Survey, path: Path, labels: Labels) -> None:
    """Write the building as it stands on the drawing."""
    model = Model(labels.title)
    storey = _structure(model, survey, labels)
    drawn = turned_up(survey, labels)
    for number, wall in enumerate(walls(building(drawn.plan), drawn.openings), start=1):
        _wall(storey, wall, f"wall {number}")
    for room in drawn.rooms:
        _space(storey, room, labels.contents.room_names.get(room.name, room.name))
    model.write(path, survey.plan)


def _structure(model: Model, survey: Survey, labels: Labels) -> _Storey:
    """Create site, building and storey."""
    site = model.part("IfcSite", "site of the flight", model.project)
    whole = model.part("IfcBuilding", "building", site)
    if labels.place is not None:
        site.RefLatitude = _degrees(labels.place.lat_deg)
        site.RefLongitude = _degrees(labels.place.lon_deg)
    if labels.heading_rad is not None:
        model.point_north(labels.heading_rad + labels.up_rad(survey.plan))
    is_height_measured = survey.plan.ceiling_m is not None
    model.say(
        whole,
        IsComplete=not labels.unfinished,
        Unfinished=labels.unfinished or None,
        Accuracy=facts(survey),
        IsHeightMeasured=is_height_measured,
    )
    if labels.unfinished:
        model.project.Description = f"{INCOMPLETE}: {labels.unfinished}"
    storey = model.part("IfcBuildingStorey", "mapped storey", whole)
    storey.Elevation = 0.0
    return _Storey(model, storey, survey.height_m, is_height_measured)


def _degrees(angle_deg: float) -> tuple[int, ...]:
    """Degrees, minutes, seconds and millionths of a second, all of one sign."""
    rest = round(abs(angle_deg) * SECONDS * MILLIONTHS)
    parts = []
    for unit in (SECONDS * MILLIONTHS, 60 * MILLIONTHS, MILLIONTHS, 1):
        part, rest = divmod(rest, unit)
        parts.append(part if angle_deg > 0 else -part)
    return tuple(parts)


def _wall(storey: _Storey, wall: Wall, name: str) -> None:
    model, height_m = storey.model, storey.height_m
    entity = model.create("IfcWall", name, "NOTDEFINED")
    model.contain(entity, storey.entity)
    model.place(entity, _xy(wall.start), _xy(wall.along))
    model.give_axis(entity, wall.length_m)
    model.give_body(entity, [[wall.of(corner).conjugate() for corner in wall.corners]], height_m)
    model.measure(
        entity,
        "Qto_WallBaseQuantities",
        {"Length": wall.length_m, "Width": wall.thickness_m, "Height": height_m},
    )
    model.say(
        entity,
        IsThicknessMeasured=wall.is_measured,
        PositionSigma=model.length(wall.sigma_m),
    )
    for number, doorway in enumerate(wall.doorways, start=1):
        opening = model.create("IfcOpeningElement", f"{name}, opening {number}", "OPENING")
        ifcopenshell.api.feature.add_feature(model.file, feature=opening, element=entity)
        _opening(storey, opening, wall, doorway)


def _opening(storey: _Storey, entity: Entity, wall: Wall, doorway: Doorway) -> None:
    """Shape an opening. There is no door in it: the drone sees no leaf."""
    model, width_m = storey.model, doorway.opening.width_m
    is_below = storey.height_m - DOORWAY_M > LINTEL_M
    height_m = DOORWAY_M if is_below else storey.height_m
    model.place(entity, _xy(wall.at(doorway.middle_m - width_m / 2)), _xy(wall.along))
    low, high = complex(0, -wall.right_m - BEYOND_M), complex(0, wall.left_m + BEYOND_M)
    model.give_body(entity, [[low, width_m + low, width_m + high, high]], height_m)
    model.measure(
        entity,
        "Qto_OpeningElementBaseQuantities",
        {"Width": width_m, "Height": height_m, "Depth": wall.thickness_m},
    )
    sigma_m = doorway.opening.sigma_m
    model.say(
        entity,
        WidthSigma=model.length(sigma_m) if sigma_m else None,
        WidthTolerance=model.length(SIGMAS * sigma_m) if sigma_m else None,
        IsHeightMeasured=False,
    )


def _space(storey: _Storey, room: Room, name: str) -> None:
    model = storey.model
    entity = model.part("IfcSpace", room.name, storey.entity, "INTERNAL")
    entity.LongName = name
    rings = (room.outline_ne_m, *room.holes_ne_m)
    model.give_body(
        entity, [[_xy(complex(*each)) for each in ring] for ring in rings], storey.height_m
    )
    quantities = {"NetFloorArea": room.area_m2}
    if storey.is_height_measured:
        quantities["Height"] = storey.height_m
    model.measure(entity, "Qto_SpaceBaseQuantities", quantities)


def _xy(place: complex) -> complex:
    """A place north + east·j as x + y·j on the paper."""
    return complex(*to_xy((place.real, place.imag)))
