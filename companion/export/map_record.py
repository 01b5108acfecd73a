"""The JSON file of a map, `map.json` and `export --format json`: its definition and its schema.

`docs/map.schema.json` is the schema that `companion map-schema` prints. A new key may be added at
any time, so readers skip keys that they do not know. `VERSION` rises if a key goes or changes its
meaning.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from msgspec import UNSET, Struct, UnsetType
from msgspec.json import encode, format, schema_components

from companion.core.errors import RecordingError
from companion.core.frames import Vector2, Vector3
from companion.core.json_schema import DIALECT, docstrings
from companion.core.messages import FloorPlan, Pose, WallSegment

if TYPE_CHECKING:  # it needs a library that the drone does without
    from companion.export.plan.survey import Survey

FORMAT: Literal["pdps-map"] = "pdps-map"
"""Tells a map from other JSON files."""
VERSION: Literal[1] = 1
"""Version of the definition."""
FRAME = "local NED: origin at take-off, x along the first heading, z down"
Covariance = tuple[Vector2, Vector2]


class UnitsRecord(Struct, frozen=True):
    """Units of all values."""

    length: Literal["m"]
    """Metres."""
    angle: Literal["rad"]
    """Radians."""
    time: Literal["s"]
    """Seconds."""
    area: Literal["m2"]
    """Square metres."""


class WallRecord(Struct, frozen=True):
    """A straight surface of a wall."""

    start_ne_m: Vector2
    """One end: north, east."""
    end_ne_m: Vector2
    """The other end."""
    length_m: float
    """Distance between the ends."""
    sigma_m: float
    """Standard deviation across the wall, at its middle."""
    normal_sigma_rad: float
    """Standard deviation of its direction."""
    covariance_across_direction: Covariance
    """Covariance of offset across the wall at its middle, and direction: m², m·rad, rad²."""
    hits: int
    """Number of ranges that ended on it."""


class SurfaceRecord(Struct, frozen=True):
    """A level surface above the floor, such as a table top."""

    centre_ne_m: Vector2
    """Its middle: north, east."""
    height_m: float
    """Height above the take-off place."""
    area_m2: float
    """Measured part of its area."""


class PoseRecord(Struct, frozen=True):
    """Where the drone was."""

    time_s: float
    """Time since the start of the program."""
    north_m: float
    """Along the first heading."""
    east_m: float
    """To the right of it."""
    down_m: float
    """Below the take-off place; negative in flight."""
    yaw_rad: float
    """Heading, clockwise from north as seen from above."""
    position_ned_m: Vector3 | UnsetType = UNSET
    """North, east and down once more; in exports only."""


class OpeningRecord(Struct, frozen=True):
    """A doorway, or another gap that beams or the drone went through."""

    start_ne_m: Vector2
    """One jamb: north, east."""
    end_ne_m: Vector2
    """The other jamb."""
    width_m: float
    """Distance between the jambs."""
    sigma_m: float
    """Standard deviation of the width; 0 if it is not known."""


class RoomRecord(Struct, frozen=True):
    """An enclosed area."""

    name: str
    """Such as "room 1", the largest."""
    area_m2: float
    """Area without the holes."""
    outline_ne_m: tuple[Vector2, ...]
    """Corners in order: north, east. The first is not repeated."""
    holes_ne_m: tuple[tuple[Vector2, ...], ...]
    """Outlines of obstacles in it, such as pillars."""


class MapRecord(Struct, frozen=True):
    """A map: walls, path and heights, and in exports rooms and openings."""

    format: Literal["pdps-map"]
    """Tells this file from other JSON files."""
    version: Literal[1]
    """Version of this definition."""
    frame: str
    """The frame of all positions and headings."""
    units: UnitsRecord
    """Units of all values."""
    ceiling_m: float | None
    """Height of the ceiling above the take-off place; null if it was not measured."""
    floor_m: float | None
    """Height of the floor above the take-off place; null if it was not measured."""
    tops: tuple[SurfaceRecord, ...]
    """Level surfaces above the floor."""
    walls: tuple[WallRecord, ...]
    """All surfaces of walls and of furniture."""
    path: tuple[PoseRecord, ...]
    """The path flown; of a joint map, one flight after the other."""
    rooms: tuple[RoomRecord, ...] | UnsetType = UNSET
    """Rooms, the largest first; in exports only."""
    openings: tuple[OpeningRecord, ...] | UnsetType = UNSET
    """Openings; in exports only."""


UNITS = UnitsRecord("m", "rad", "s", "m2")
STRUCTS = (
    UnitsRecord,
    WallRecord,
    SurfaceRecord,
    PoseRecord,
    OpeningRecord,
    RoomRecord,
    MapRecord,
)
"""All parts of the definition."""


def check_version(record: Mapping[str, object], path: Path) -> None:
    """Check that this program reads the version of a map; the first maps have none.

    Raises:
        RecordingError: a later program wrote it.
    """
    version = record.get("version", VERSION)
    if not isinstance(version, int) or version > VERSION:
        raise RecordingError(
            f"{path}: version = {version!r}: this program reads versions up to {VERSION}; "
            "update pdps-companion"
        )


def map_record(
    plan: FloorPlan,
    rooms: tuple[RoomRecord, ...] | UnsetType = UNSET,
    openings: tuple[OpeningRecord, ...] | UnsetType = UNSET,
    *,
    with_positions: bool = False,
) -> MapRecord:
    """The record of a map. `with_positions`: give each pose its position as a triple, too."""
    return MapRecord(
        format=FORMAT,
        version=VERSION,
        frame=FRAME,
        units=UNITS,
        ceiling_m=plan.ceiling_m,
        floor_m=plan.floor_m,
        tops=tuple(SurfaceRecord(top.centre_ne_m, top.height_m, top.area_m2) for top in plan.tops),
        walls=tuple(_wall(wall) for wall in plan.walls),
        path=tuple(_pose(pose, with_position=with_positions) for pose in plan.path),
        rooms=rooms,
        openings=openings,
    )


def _wall(wall: WallSegment) -> WallRecord:
    return WallRecord(
        wall.start_ne_m,
        wall.end_ne_m,
        wall.length_m,
        wall.sigma_m,
        wall.normal_sigma_rad,
        ((wall.sigma_m**2, 0.0), (0.0, wall.normal_sigma_rad**2)),
        wall.hits,
    )


def _pose(pose: Pose, *, with_position: bool) -> PoseRecord:
    place = pose.north_m, pose.east_m, pose.down_m
    return PoseRecord(pose.time_s, *place, pose.yaw_rad, place if with_position else UNSET)


def write_json(survey: "Survey", path: Path) -> None:
    """Write a map with its rooms and openings, as an export."""
    rooms = tuple(
        RoomRecord(room.name, room.area_m2, room.outline_ne_m, room.holes_ne_m)
        for room in survey.rooms
    )
    openings = tuple(
        OpeningRecord(each.start_ne_m, each.end_ne_m, each.width_m, each.sigma_m)
        for each in survey.openings
    )
    record = map_record(survey.plan, rooms, openings, with_positions=True)
    path.write_text(in_json(record), encoding="utf-8")


def in_json(record: MapRecord) -> str:
    """The content of the file."""
    return format(encode(record, enc_hook=_number), indent=1).decode() + "\n"


def _number(number: Any) -> Any:
    """A number of numpy as one of Python; arithmetic with arrays may leave one in a map."""
    return number.item()


def map_schema() -> dict[str, Any]:
    """JSON schema of the file, draft 2020-12. Docstrings are the descriptions."""
    (whole,), definitions = schema_components([MapRecord], ref_template="#/$defs/{name}")
    for struct in STRUCTS:
        for key, text in docstrings(struct):
            definitions[struct.__name__]["properties"][key]["description"] = text
    return {"$schema": DIALECT, "title": "PDPS map", **whole, "$defs": definitions}
