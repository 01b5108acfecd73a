"""Builds clutter pieces from upright slabs and sheets at a place and direction.

Plan coordinates are (north, east) in m. A piece's own coordinates are x along its width and y along
its depth, from its middle.
"""

import random
from collections.abc import Iterable
from dataclasses import dataclass

import shapely

from companion.core.frames import Vector2
from sitl.world.format import Walls

DECIMALS = 3
"""Decimals of all coordinates in m, so that rounding errors of machines have no effect."""
ALONG_NORTH: Vector2 = (1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Spot:
    """A place and the direction of a piece's width, a unit vector."""

    place: Vector2
    along: Vector2 = ALONG_NORTH

    @property
    def across(self) -> Vector2:
        """Direction of the depth: a quarter turn from north to east."""
        return -self.along[1], self.along[0]

    def at(self, x_m: float, y_m: float) -> Vector2:
        """Plan coordinates for a piece's own coordinates."""
        (north, east), (u_n, u_e), (v_n, v_e) = self.place, self.along, self.across
        return (
            round(north + x_m * u_n + y_m * v_n, DECIMALS),
            round(east + x_m * u_e + y_m * v_e, DECIMALS),
        )

    def moved(self, x_m: float, y_m: float) -> "Spot":
        return Spot(self.at(x_m, y_m), self.along)

    def rectangle(self, width_m: float, depth_m: float) -> shapely.Polygon:
        """A rectangle centred on this place."""
        x, y = width_m / 2, depth_m / 2
        return shapely.Polygon([self.at(-x, -y), self.at(x, -y), self.at(x, y), self.at(-x, y)])


@dataclass(frozen=True, slots=True)
class Piece:
    """An object that stands or hangs in a room."""

    walls: tuple[Walls, ...]
    footprint: shapely.Polygon
    """Outline from above, independent of height; excludes a wall that the piece touches."""
    anchor: Vector2 | None = None
    """A place in the piece's room; default is the footprint's middle."""


def slab(spot: Spot, width_m: float, depth_m: float, bottom_m: float, top_m: float) -> Walls:
    """A solid block; heights above the floor in m."""
    half_m = width_m / 2
    return Walls(
        points=(spot.at(-half_m, 0.0), spot.at(half_m, 0.0)),
        thickness_m=round(depth_m, DECIMALS),
        bottom_m=round(bottom_m, DECIMALS),
        top_m=round(top_m, DECIMALS),
    )


def sheet(points: Iterable[Vector2], bottom_m: float, top_m: float, *, closed: bool) -> Walls:
    """A surface along a polyline; heights above the floor in m."""
    return Walls(
        points=tuple(points),
        closed=closed,
        bottom_m=round(bottom_m, DECIMALS),
        top_m=round(top_m, DECIMALS),
    )


def any_direction(rng: random.Random) -> Vector2:
    """A random unit vector."""
    sign = 1.0 if rng.random() < 0.5 else -1.0
    north, east = turned(rng.uniform(-1.0, 1.0))
    return sign * north, sign * east


def turned(half_tangent: float) -> Vector2:
    """(cos a, sin a) for the tangent of a/2, without trigonometric functions."""
    square = half_tangent * half_tangent
    return (1 - square) / (1 + square), 2 * half_tangent / (1 + square)
