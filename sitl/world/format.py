"""Defines the text format of worlds and reads it.

name = "kitchen"            # one room or a whole building
height_m = 2.6              # ceiling height

[[walls]]                   # a polyline seen from above, [north, east] in metres
points = [[0, 0], [4, 0], [4, 3]]
closed = false              # true joins the last point to the first
bottom_m = 0                # heights above the floor; top_m defaults to the ceiling
top_m = 2.6
glass = false               # true: light passes, a drone does not

[[boxes]]                   # a solid: furniture, a pillar
corner = [1, 1]             # smallest north and east
size = [0.8, 1.6]
bottom_m = 0
top_m = 0.75

[[starts]]                  # take-off places; the seed draws the heading if there is none
name = "door"
position = [2, 1.5]
heading_deg = 90
"""

import math
import tomllib
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, InstanceOf, ValidationError, model_validator

from companion.core.frames import Vector2
from sitl.core.errors import SitlError, error_line
from sitl.world.geometry.triangles import Mesh
from sitl.world.known import KnownArea

MIN_LENGTH_M = 0.01
"""Shorter walls and boxes are invalid, m. Chosen."""
ON_WALL_M = 0.05
"""Largest distance of a door's centre from its wall, m. Chosen."""
MAX_LETTERS = 500
"""Longest text of an error, characters. Chosen."""

Segment = tuple[Vector2, Vector2]

Metres = Annotated[float, Field(ge=-1000, le=1000, allow_inf_nan=False)]
Height = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]


class WorldError(SitlError, ValueError):
    """A world does not exist or is invalid; the text names file, key and value."""

    def __init__(self, message: str) -> None:
        """Join the message to one line and limit its length."""
        line = " ".join(message.splitlines())
        super().__init__(line if len(line) <= MAX_LETTERS else f"{line[:MAX_LETTERS]} ...")


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Door(_Part):
    """An opening in a wall."""

    centre: tuple[Metres, Metres]
    width_m: float = Field(ge=0.1, le=20)
    height_m: float = Field(2.0, ge=0.1, le=20)


@dataclass(frozen=True, slots=True)
class Panel:
    """An upright rectangle of wall; in the plan it reaches from `start` to `end`, (north, east)."""

    start: Vector2
    end: Vector2
    bottom_m: float
    top_m: float
    thickness_m: float = 0.0
    glass: bool = False

    @property
    def outline(self) -> list[Segment]:
        """Segments seen from above: the panel itself, or the four sides of a thick one."""
        if self.thickness_m <= 0:
            return [(self.start, self.end)]
        north = self.end[0] - self.start[0]
        east = self.end[1] - self.start[1]
        share = self.thickness_m / 2 / math.hypot(north, east)
        aside = -east * share, north * share
        corners = [
            (point[0] + side * aside[0], point[1] + side * aside[1])
            for point, side in ((self.start, 1), (self.end, 1), (self.end, -1), (self.start, -1))
        ]
        return list(pairwise([*corners, corners[0]]))


class Walls(_Part):
    """Walls along a polyline, with doors in them."""

    points: tuple[tuple[Metres, Metres], ...] = Field(min_length=2)
    closed: bool = False
    thickness_m: float = Field(0.0, ge=0, le=2)
    bottom_m: Height = 0.0
    top_m: Height | None = None
    glass: bool = False
    """Light passes, a drone does not: no beam detects it, and scores do not expect it in maps."""
    doors: tuple[Door, ...] = ()

    @property
    def segments(self) -> list[Segment]:
        points = [*self.points, self.points[0]] if self.closed else list(self.points)
        return list(pairwise(points))

    def panels(self, ceiling_m: float) -> list[Panel]:
        """The walls as panels, with doors cut out and lintels above them."""
        top_m = ceiling_m if self.top_m is None else self.top_m
        panels = []
        for start, end in self.segments:
            length_m = math.dist(start, end)
            gaps = sorted(gap for door in self.doors if (gap := _gap(door, start, end)))
            at_m = 0.0
            for from_m, to_m, height_m in gaps:
                panels.append((start, end, at_m, from_m, self.bottom_m))
                panels.append((start, end, from_m, to_m, height_m))
                at_m = to_m
            panels.append((start, end, at_m, length_m, self.bottom_m))
        return [
            Panel(
                _between(s, e, a), _between(s, e, b), bottom_m, top_m, self.thickness_m, self.glass
            )
            for s, e, a, b, bottom_m in panels
            if b - a > MIN_LENGTH_M and top_m - bottom_m > MIN_LENGTH_M
        ]

    @model_validator(mode="after")
    def _is_not_degenerate(self) -> "Walls":
        for start, end in self.segments:
            if math.dist(start, end) < MIN_LENGTH_M:
                raise ValueError(f"{start} and {end} are the same point; leave one out")
        for door in self.doors:
            if not any(_gap(door, start, end) for start, end in self.segments):
                raise ValueError(f"the door at {door.centre} is on none of the walls, or too wide")
        return self


def _gap(door: Door, start: Vector2, end: Vector2) -> tuple[float, float, float] | None:
    """Begin, end and height of a door along a wall, m; None if the wall does not contain it."""
    length_m = math.dist(start, end)
    north, east = (end[0] - start[0]) / length_m, (end[1] - start[1]) / length_m
    to_north, to_east = door.centre[0] - start[0], door.centre[1] - start[1]
    along_m, across_m = to_north * north + to_east * east, to_east * north - to_north * east
    half_m = door.width_m / 2
    inside = half_m <= along_m <= length_m - half_m
    if abs(across_m) > ON_WALL_M or not inside:
        return None
    return along_m - half_m, along_m + half_m, door.height_m


def _between(start: Vector2, end: Vector2, along_m: float) -> Vector2:
    share = along_m / math.dist(start, end)
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


class Box(_Part):
    """A solid block with its sides along north and east."""

    corner: tuple[Metres, Metres]
    size: tuple[
        Annotated[float, Field(ge=MIN_LENGTH_M, le=1000)],
        Annotated[float, Field(ge=MIN_LENGTH_M, le=1000)],
    ]
    bottom_m: Height = 0.0
    top_m: Height

    @property
    def segments(self) -> list[Segment]:
        (north, east), (depth, width) = self.corner, self.size
        corners = [
            (north, east),
            (north + depth, east),
            (north + depth, east + width),
            (north, east + width),
        ]
        return list(pairwise([*corners, corners[0]]))

    @model_validator(mode="after")
    def _stands_upright(self) -> "Box":
        if self.top_m <= self.bottom_m:
            raise ValueError(f"top_m {self.top_m} must be above bottom_m {self.bottom_m}")
        return self


class Start(_Part):
    """A take-off place."""

    name: str
    position: tuple[Metres, Metres]
    heading_deg: float | None = Field(None, ge=-360, le=360)


class World(_Part):
    """A room or building. Plan coordinates are (north, east), m."""

    name: str
    height_m: float = Field(ge=0.5, le=100)
    walls: tuple[Walls, ...] = ()
    boxes: tuple[Box, ...] = ()
    starts: tuple[Start, ...] = Field(min_length=1)
    mesh: InstanceOf[Mesh] | None = Field(None, repr=False)
    """Further geometry from an importer; not part of the text format."""
    known: InstanceOf[KnownArea] | None = Field(None, repr=False)
    """Extent of an importer's map; None if the whole world is known."""

    @property
    def panels(self) -> list[Panel]:
        """All walls with doors cut out."""
        return [panel for walls in self.walls for panel in walls.panels(self.height_m)]

    @property
    def closed_border(self) -> tuple[Segment, ...]:
        """Walls at the border to the unknown. The simulated world and its scores end there."""
        return () if self.known is None else self.known.border

    @property
    def bounds(self) -> tuple[Vector2, Vector2]:
        """Smallest and largest (north, east) of all walls, boxes and meshes."""
        points = [point for panel in self.panels for point in (panel.start, panel.end)]
        points += [point for box in self.boxes for segment in box.segments for point in segment]
        if self.mesh is not None:
            points += [(float(north), float(east)) for north, east, _ in self.mesh.extremes]
        norths, easts = zip(*points, strict=True)
        return (min(norths), min(easts)), (max(norths), max(easts))

    @model_validator(mode="after")
    def _has_something_to_map(self) -> "World":
        if not self.walls and not self.boxes and self.mesh is None:
            raise ValueError("no walls and no boxes; add [[walls]]")
        return self


def parse_world(text: str, source: str) -> World:
    """Parse a world file.

    Raises:
        WorldError: the text is not TOML, a key is unknown or a value out of bounds.
    """
    try:
        return World.model_validate(tomllib.loads(text))
    except ValidationError as error:
        raise WorldError(f"{source}: {error_line(error)}") from error
    except (ValueError, RecursionError) as error:  # also from huge numbers and deep nesting
        raise WorldError(f"{source}: not TOML: {error}") from error
