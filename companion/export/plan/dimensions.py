"""Places dimensions beside walls, so that no text lies on another or on a wall.

The longest walls come first. The dimension of a wall that was seen from one side is placed behind
it if there is room, else before it; a wall for which no line is free gets no dimension. Of a solid
wall one surface is measured. Outside stand the overall dimensions of the building.
"""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.messages import WallSegment
from companion.core.values import value
from companion.export.plan.building import Building
from companion.export.plan.turned import main_direction_rad, to_xy

if TYPE_CHECKING:  # they need a library that the drone does without
    from companion.export.plan.survey import Opening

MIN_LENGTH_M = 0.6
"""Shortest wall that gets a dimension, m. Chosen."""
TEXT_MM, OPENING_MM = 2.5, 2.0
"""Font sizes of walls and openings, mm. Chosen."""
OFF_MM, LINES_MM, TEXT_OFF_MM = 3.5, 5.0, 2.0
"""Distance from a wall to its dimension line, between two such lines, and from a line to the middle
of its text, mm. Chosen."""
SIGMAS = 2
"""Tolerance of an opening's width in sigmas: 19 of 20."""
LINES = 2
"""Number of lines on either side of a wall. Chosen."""
CHARACTER = 0.6
"""Width of a character by its height; of common fonts."""
MOST_RAD = math.radians(95)
"""Largest direction of a text, rad. Chosen: walls are a little aslant."""
WHOLE = 0.97
"""A wall of this share of the building has the building's own length. Chosen."""


@value
class Dimension:
    """A length, with its dimension line."""

    start_xy_m: Vector2
    end_xy_m: Vector2
    """The measured points."""
    off_xy_m: Vector2
    """From the measured points to the dimension line; zero without a line."""
    text: str
    text_xy_m: Vector2
    height_mm: float

    @property
    def line(self) -> Array:
        """(1, 4): the dimension line: x and y of both ends, m."""
        start, end = (np.add(each, self.off_xy_m) for each in (self.start_xy_m, self.end_xy_m))
        return np.array([[*start, *end]])

    @property
    def angle_rad(self) -> float:
        """Direction of the text: readable from below, and along an upright wall from the right."""
        (x_a, y_a), (x_b, y_b) = self.start_xy_m, self.end_xy_m
        return MOST_RAD - (MOST_RAD - math.atan2(y_b - y_a, x_b - x_a)) % math.pi


class Placing:
    """Places texts one after the other."""

    def __init__(self, parts: Building, m_per_mm: float) -> None:
        self._parts, self._m_per_mm = parts, m_per_mm
        self._circles: Array = np.empty((0, 3))
        """(n, 3): circles that cover the texts: x, y, radius, m."""
        self._lines: Array = np.array(
            [
                (*to_xy(wall.start_ne_m), *to_xy(wall.end_ne_m))
                for wall in (*parts.walls, *parts.furniture)
            ]
        ).reshape(-1, 4)
        """(n, 4): lines that no text may lie on: x and y of both ends, m."""

    def keep_off(self, text: str, at_xy_m: Vector2, height_mm: float, angle_rad: float = 0) -> None:
        """Note a text that is placed already."""
        new = self._covering(text, at_xy_m, height_mm, angle_rad)
        self._circles = np.concatenate([self._circles, new])

    def dimensions(self, openings: Sequence["Opening"]) -> Iterator[Dimension]:
        """Dimensions of openings, walls and the building."""
        for opening in openings:
            start, end = to_xy(opening.start_ne_m), to_xy(opening.end_ne_m)
            text = f"{opening.width_m:.2f}"
            if opening.sigma_m:
                text += f" ± {SIGMAS * opening.sigma_m:.2f}"
            yield from self._placed(_opening(start, end, side, text) for side in (1, -1))
        walls = [
            wall
            for wall in self._parts.walls
            if wall.length_m >= MIN_LENGTH_M and wall not in self._parts.second_faces
        ]
        for wall in sorted(walls, key=lambda wall: -wall.length_m):
            start, end = to_xy(wall.start_ne_m), to_xy(wall.end_ne_m)
            yield from self._placed(self._candidates(start, end, self._behind_xy(wall)))
        yield from self._overall()

    def _behind_xy(self, wall: WallSegment) -> Vector2:
        """Unit vector across a wall, away from where it was seen if that was one side."""
        for face in self._parts.faces:
            if face.wall == wall:
                return to_xy(face.behind_ne)
        (x_a, y_a), (x_b, y_b) = to_xy(wall.start_ne_m), to_xy(wall.end_ne_m)
        return (y_a - y_b) / wall.length_m, (x_b - x_a) / wall.length_m

    def _overall(self) -> Iterator[Dimension]:
        """Length and width of the building along its main walls, on two sides of it."""
        walls = self._parts.walls
        if not walls:
            return
        ends = np.array([to_xy(end) for wall in walls for end in (wall.start_ne_m, wall.end_ne_m)])
        turn_rad = main_direction_rad(walls)  # clockwise on the paper, where headings go that way
        along = np.array((math.cos(turn_rad), -math.sin(turn_rad)))
        up = np.array((math.sin(turn_rad), math.cos(turn_rad)))
        off_m = (OFF_MM + LINES * LINES_MM) * self._m_per_mm
        spans = [(ends @ axis).tolist() for axis in (along, up)]
        low = [min(span) for span in spans]
        for number, (axis, beside) in enumerate(((along, up), (up, along))):
            length_m = max(spans[number]) - low[number]
            has_own = any(wall.length_m > WHOLE * length_m for wall in self._walls_along(axis))
            if has_own or length_m < MIN_LENGTH_M:
                continue
            start = low[0] * along + low[1] * up
            first, last, off = start, start + length_m * axis, -off_m * beside
            yield from self._placed([self._dimension(_pair(first), _pair(last), _pair(off))])

    def _walls_along(self, axis: Array) -> list[WallSegment]:
        return [
            wall
            for wall in self._parts.walls
            if abs(np.subtract(to_xy(wall.end_ne_m), to_xy(wall.start_ne_m)) @ axis)
            > wall.length_m / math.sqrt(2)
        ]

    def _placed(self, candidates: Sequence[Dimension] | Iterator[Dimension]) -> Iterator[Dimension]:
        """The first candidate whose text is free."""
        for each in candidates:
            text = each.text, each.text_xy_m, each.height_mm, each.angle_rad
            if self._is_free(self._covering(*text)) and not self._crosses_text(each.line):
                self.keep_off(*text)
                if any(each.off_xy_m):
                    self._lines = np.concatenate([self._lines, each.line])
                yield each
                return

    def _crosses_text(self, line: Array) -> bool:
        """True if a line (1, 4) lies on a text."""
        off_m = _distances_m(self._circles[:, :2], line)
        return bool((off_m < self._circles[:, 2:]).any())

    def _candidates(self, start: Vector2, end: Vector2, side: Vector2) -> Iterator[Dimension]:
        for sign in (1, -1):
            for line in range(LINES):
                off_m = sign * (OFF_MM + line * LINES_MM) * self._m_per_mm
                yield self._dimension(start, end, (off_m * side[0], off_m * side[1]))

    def _dimension(self, start: Vector2, end: Vector2, off: Vector2) -> Dimension:
        beyond = 1 + TEXT_OFF_MM * self._m_per_mm / math.hypot(*off)
        middle = (
            (start[0] + end[0]) / 2 + beyond * off[0],
            (start[1] + end[1]) / 2 + beyond * off[1],
        )
        return Dimension(start, end, off, f"{math.dist(start, end):.2f}", middle, TEXT_MM)

    def _covering(self, text: str, at_xy_m: Vector2, height_mm: float, angle_rad: float) -> Array:
        """Circles (n, 3) along a text that cover it: x, y, radius, m."""
        height_m = height_mm * self._m_per_mm
        half_m = 0.5 * CHARACTER * height_m * len(text)
        along_m = np.linspace(-half_m, half_m, 1 + math.ceil(4 * half_m / height_m))
        return np.column_stack(
            [
                at_xy_m[0] + along_m * math.cos(angle_rad),
                at_xy_m[1] + along_m * math.sin(angle_rad),
                np.full(len(along_m), 0.6 * height_m),
            ]
        )

    def _is_free(self, circles: Array) -> bool:
        """True if circles (n, 3) touch no text and no wall."""
        others = self._circles
        off_m = np.hypot(*(circles[:, None, :2] - others[:, :2]).transpose(2, 0, 1))
        if (off_m < circles[:, None, 2] + others[:, 2]).any():
            return False
        return not (_distances_m(circles[:, :2], self._lines) < circles[:, 2:]).any()


def _opening(start: Vector2, end: Vector2, side: int, text: str) -> Dimension:
    """The width of an opening, beside its middle, without a line."""
    width_m = math.dist(start, end)
    off = 0.35 * side / width_m
    middle = (
        (start[0] + end[0]) / 2 + off * (start[1] - end[1]),
        (start[1] + end[1]) / 2 + off * (end[0] - start[0]),
    )
    return Dimension(start, end, (0.0, 0.0), text, middle, OPENING_MM)


def _distances_m(points: Array, lines: Array) -> Array:
    """(n, m): distances of points (n, 2) from lines (m, 4)."""
    start, along = lines[:, :2], lines[:, 2:] - lines[:, :2]
    length_m2 = np.maximum((along * along).sum(axis=1), 1e-12)
    off = points[:, None] - start
    share = np.clip((off * along).sum(axis=2) / length_m2, 0.0, 1.0)
    distances: Array = np.hypot(*(off - share[..., None] * along).transpose(2, 0, 1))
    return distances


def _pair(vector: Array) -> Vector2:
    return float(vector[0]), float(vector[1])
