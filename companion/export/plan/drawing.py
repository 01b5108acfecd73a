"""Draws the floor plan once, as shapes on layers, for paper, CAD and pictures.

    map ─► turned (turned.py) ─► building and furniture (building.py) ─┐
       └─► rooms and openings (survey.py) ─────────────────────────────┴─► shapes

Coordinates are metres on the paper: x to the right, y up. Sizes of text are millimetres on the
paper, so the shapes are those of one scale.
"""

from collections.abc import Iterator, Sequence
from dataclasses import field
from enum import StrEnum
from typing import TYPE_CHECKING

from companion.core.frames import Vector2
from companion.core.messages import FloorPlan, WallSegment
from companion.core.values import value
from companion.export.plan.building import Building, building
from companion.export.plan.dimensions import SIGMAS, Dimension, Placing
from companion.export.plan.turned import to_xy

if TYPE_CHECKING:  # they need a library that the drone does without
    from companion.export.plan.survey import Opening, Room

BAND_MM = 1.0
"""Width of the band behind a wall that was seen from one side, mm. Chosen."""
NAME_MM, AREA_MM = 3.2, 2.8
"""Font sizes of the texts of a room, mm. Chosen."""


class Layer(StrEnum):
    """Layers, from the lowest to the uppermost."""

    ROOMS = "ROOMS"
    POINTS = "POINTS"
    PATH = "PATH"
    UNSEEN = "UNSEEN"
    """Borders of what was seen, on an unfinished map."""
    BEHIND = "WALLS-ONE-SIDE"
    """Behind walls that were seen from one side."""
    SOLID = "WALLS-SOLID"
    """Between the two surfaces of walls that were seen from both sides."""
    FURNITURE = "FURNITURE"
    WALLS = "WALLS"
    """Surfaces of walls."""
    OPENINGS = "OPENINGS"
    DIMENSIONS = "DIMENSIONS"
    LABELS = "LABELS"
    TITLE = "TITLE"
    """Title block."""


@value
class Stroke:
    """A line through points."""

    layer: Layer
    points_xy_m: tuple[Vector2, ...]


@value
class Area:
    """A filled area with an outline and holes."""

    layer: Layer
    rings_xy_m: tuple[tuple[Vector2, ...], ...]


@value
class Doorway:
    """An opening in a wall."""

    start_xy_m: Vector2
    end_xy_m: Vector2
    tolerance_m: float
    """Of its width, 19 in 20; 0 if it is not known."""


@value
class Label:
    """A text, centred."""

    text: str
    at_xy_m: Vector2
    height_mm: float


@value
class Drawing:
    """The plan of one scale."""

    strokes: tuple[Stroke, ...]
    areas: tuple[Area, ...]
    doorways: tuple[Doorway, ...]
    """On the layer of openings."""
    labels: tuple[Label, ...]
    dimensions: tuple[Dimension, ...]
    points_xy_m: tuple[Vector2, ...]
    """Ends of beams."""
    paths_xy_m: tuple[tuple[Vector2, ...], ...]
    """Paths of the flights."""


@value
class Contents:
    """What is drawn, apart from the building."""

    path: bool = True
    points: bool = True
    room_names: dict[str, str] = field(default_factory=dict)
    """Names of rooms by their numbers, such as `room 1`."""


def draw(
    plan: FloorPlan,
    rooms: Sequence["Room"],
    openings: Sequence["Opening"],
    contents: Contents,
    m_per_mm: float,
    *,
    unseen_ne_m: Sequence[Sequence[Vector2]] = (),
) -> Drawing:
    """Draw a map that is turned already.

    `m_per_mm`: metres for each millimetre of paper; `unseen_ne_m`: borders of what was seen.
    """
    parts = building(plan)
    labels = [
        label for room in rooms for label in _labels(room, parts.furniture, contents, m_per_mm)
    ]
    placing = Placing(parts, m_per_mm)
    for label in labels:
        placing.keep_off(label.text, label.at_xy_m, label.height_mm)
    dimensions = tuple(placing.dimensions(openings))
    return Drawing(
        tuple(_strokes(parts, unseen_ne_m)),
        tuple(_areas(parts, rooms, m_per_mm)),
        tuple(map(_doorway, openings)),
        tuple(labels),
        dimensions,
        tuple((hit.position_ned_m[1], hit.position_ned_m[0]) for hit in plan.hits)
        if contents.points
        else (),
        tuple(tuple(to_xy(pose.ne_m) for pose in flown) for flown in plan.paths)
        if contents.path
        else (),
    )


def _strokes(parts: Building, unseen_ne_m: Sequence[Sequence[Vector2]]) -> Iterator[Stroke]:
    for border in unseen_ne_m:
        yield Stroke(Layer.UNSEEN, tuple(map(to_xy, border)))
    for wall in parts.furniture:
        yield Stroke(Layer.FURNITURE, _line(wall))
    for wall in parts.walls:
        yield Stroke(Layer.WALLS, _line(wall))


def _doorway(opening: "Opening") -> Doorway:
    start, end = to_xy(opening.start_ne_m), to_xy(opening.end_ne_m)
    return Doorway(start, end, SIGMAS * opening.sigma_m)


def _areas(parts: Building, rooms: Sequence["Room"], m_per_mm: float) -> Iterator[Area]:
    for room in rooms:
        rings = (room.outline_ne_m, *room.holes_ne_m)
        yield Area(Layer.ROOMS, tuple(tuple(map(to_xy, ring)) for ring in rings))
    for face in parts.faces:
        back_m = tuple(BAND_MM * m_per_mm * each for each in face.behind_ne)
        ends = face.start_ne_m, face.end_ne_m
        behind = tuple((north + back_m[0], east + back_m[1]) for north, east in reversed(ends))
        yield Area(Layer.BEHIND, (tuple(map(to_xy, (*ends, *behind))),))
    for solid in parts.solids:
        yield Area(Layer.SOLID, (tuple(map(to_xy, solid.ring_ne_m)),))


def _labels(
    room: "Room", furniture: Sequence[WallSegment], contents: Contents, m_per_mm: float
) -> Iterator[Label]:
    x, y = to_xy(room.label_ne_m(furniture))
    off_m = 0.8 * NAME_MM * m_per_mm
    yield Label(contents.room_names.get(room.name, room.name), (x, y + off_m), NAME_MM)
    yield Label(f"{room.area_m2:.1f} m²", (x, y - off_m), AREA_MM)


def _line(wall: WallSegment) -> tuple[Vector2, Vector2]:
    return to_xy(wall.start_ne_m), to_xy(wall.end_ne_m)
