"""What clutter is made of: upright slabs and sheets at a place, turned any way.

Plan coordinates are (north, east) in metres; a piece's own are x along its width, y along its
depth, from its middle.
"""

import random
from collections.abc import Iterable
from dataclasses import dataclass

import shapely

from companion.core.frames import Vector2
from sitl.world.format import Walls

DECIMALS = 3
"""Of all coordinates, metres: so no machine's rounding of the last bit tells."""
ALONG_NORTH: Vector2 = (1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Spot:
    """A place and the direction of a piece's width, a unit vector."""

    place: Vector2
    along: Vector2 = ALONG_NORTH

    @property
    def across(self) -> Vector2:
        """The direction of its depth: a quarter turn, from north to east."""
        return -self.along[1], self.along[0]

    def at(self, x_m: float, y_m: float) -> Vector2:
        """A piece's own coordinates in the plan."""
        (north, east), (u_n, u_e), (v_n, v_e) = self.place, self.along, self.across
        return (
            round(north + x_m * u_n + y_m * v_n, DECIMALS),
            round(east + x_m * u_e + y_m * v_e, DECIMALS),
        )

    def moved(self, x_m: float, y_m: float) -> "Spot":
        return Spot(self.at(x_m, y_m), self.along)

    def rectangle(self, width_m: float, depth_m: float) -> shapely.Polygon:
        """About its place."""
        x, y = width_m / 2, depth_m / 2
        return shapely.Polygon([self.at(-x, -y), self.at(x, -y), self.at(x, y), self.at(-x, y)])


@dataclass(frozen=True, slots=True)
class Piece:
    """Something that stands or hangs there."""

    walls: tuple[Walls, ...]
    footprint: shapely.Polygon
    """Seen from above, whatever its height; a wall that it touches is not part of it."""
    anchor: Vector2 | None = None
    """A place of the room that it is in; the footprint's middle if left out."""


def slab(spot: Spot, width_m: float, depth_m: float, bottom_m: float, top_m: float) -> Walls:
    """A solid block, heights above the floor in metres."""
    half_m = width_m / 2
    return Walls(
        points=(spot.at(-half_m, 0.0), spot.at(half_m, 0.0)),
        thickness_m=round(depth_m, DECIMALS),
        bottom_m=round(bottom_m, DECIMALS),
        top_m=round(top_m, DECIMALS),
    )


def sheet(points: Iterable[Vector2], bottom_m: float, top_m: float, *, closed: bool) -> Walls:
    """A surface along a polyline, heights above the floor in metres."""
    return Walls(
        points=tuple(points),
        closed=closed,
        bottom_m=round(bottom_m, DECIMALS),
        top_m=round(top_m, DECIMALS),
    )


def any_direction(rng: random.Random) -> Vector2:
    """A unit vector by chance."""
    sign = 1.0 if rng.random() < 0.5 else -1.0
    north, east = turned(rng.uniform(-1.0, 1.0))
    return sign * north, sign * east


def turned(half_tangent: float) -> Vector2:
    """(cos a, sin a) of the angle a whose half has this tangent, without trigonometry."""
    square = half_tangent * half_tangent
    return (1 - square) / (1 + square), 2 * half_tangent / (1 + square)
