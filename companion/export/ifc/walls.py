"""Makes the walls of a BIM model from the pieces of the plan.

    ▓▓▓▓▓▓▓▓      ▓▓▓▓▓▓ ▓▓▓▓▓         pieces that were seen from both sides, a doorway, a gap
    ▓▓▓▓▓▓▓▓┄┄┄┄┄┄▓▓▓▓▓▓▓▓▓▓▓▓         one wall with a doorway in it

The drawing shows pieces of wall as they were seen. In a BIM model an opening is in a wall, and
walls meet at their corners. So pieces in line are one wall if nothing but a doorway, or a gap too
short for one, is between them; and walls are extended to the corner that they end near to.

A place is a complex number: north + east·j, m. With `along`, the direction of a wall, the product
place · conj(along) has the distance along the wall as its real part, and to the right of the wall
as its imaginary part.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.sparse.csgraph import connected_components

from companion.core.frames import Vector2
from companion.core.values import value
from companion.export.plan.building import SAME_DIRECTION, SHORTEST_M, TOUCHING_M, Building
from companion.export.plan.survey import Opening

NOMINAL_M = 0.1
"""Thickness of a wall that was seen from one side, m. Chosen: that of a light partition."""
OFF_LINE_M = 0.1
"""Largest lateral offset of two pieces of one wall, m. Chosen: two sigmas of a surface."""
AS_THICK_M = 0.05
"""Largest difference in thickness of two pieces of one wall, m. Chosen."""
AT_DOORWAY_M = 0.3
"""A wall ends at a doorway if it ends this near to it, along or across, m. Chosen: as
`SHORTEST_M`, and beyond a wall's thickness."""
ALONG_DOORWAY = math.cos(math.radians(25))
"""Cosine of the largest angle between a wall and a doorway in it. Chosen: the doorway may go from
one surface to the other."""
MOST_MITRE = 3.0
"""Greatest length of a mitre by the walls' thickness. Chosen: a corner of 40°."""


@value
class Doorway:
    """An opening in a wall."""

    opening: Opening
    middle_m: float
    """Place of its middle along the wall."""


@value
class Wall:
    """A wall with two surfaces and its doorways, in the frame of the building it is made of."""

    start: complex
    end: complex
    """The middle of the wall if its thickness is measured, else the surface that was seen."""
    left_m: float
    right_m: float
    """To the left and right surface."""
    is_measured: bool
    """True if both surfaces were seen. Otherwise the thickness is nominal."""
    sigma_m: float
    """Sigma across the wall."""
    doorways: tuple[Doorway, ...] = ()
    corners: tuple[complex, ...] = ()
    """Left and right corner at the start, right and left corner at the end."""

    @property
    def along(self) -> complex:
        """Its direction, of length 1."""
        return (self.end - self.start) / self.length_m

    @property
    def length_m(self) -> float:
        return abs(self.end - self.start)

    @property
    def thickness_m(self) -> float:
        return self.left_m + self.right_m

    def of(self, place: complex) -> complex:
        """Along the wall from its start, and to the right of it, m."""
        return (place - self.start) * self.along.conjugate()

    def at(self, along_m: float) -> complex:
        """A place on the line from start to end."""
        return self.start + along_m * self.along

    def turned_round(self) -> "Wall":
        """The same body from its end to its start; its doorways are not turned."""
        return replace(
            self, start=self.end, end=self.start, left_m=self.right_m, right_m=self.left_m
        )


def walls(parts: Building, openings: Sequence[Opening]) -> tuple[Wall, ...]:
    """The walls of a building, each opening in one of them."""
    pieces = list(_pieces(parts))
    made = [_joined(group) for group in _groups(pieces, openings)]
    for opening in openings:
        number = _host(made, opening)
        if number is None:
            made.append(_beside_nothing(opening))
            number = len(made) - 1
        made[number] = _with_doorway(made[number], opening)
    return tuple(_with_corners(_closed(made)))


def _place(place_ne_m: Vector2) -> complex:
    return complex(*place_ne_m)


def _pieces(parts: Building) -> Iterator[Wall]:
    for solid in parts.solids:
        one, other, back, first = map(_place, solid.ring_ne_m)
        half_m = solid.thickness_m / 2
        yield Wall((one + first) / 2, (other + back) / 2, half_m, half_m, True, solid.sigma_m)
    for face in parts.faces:
        start, end = _place(face.start_ne_m), _place(face.end_ne_m)
        is_right = (_place(face.behind_ne) * (end - start).conjugate()).imag > 0
        left_m, right_m = (0.0, NOMINAL_M) if is_right else (NOMINAL_M, 0.0)
        yield Wall(start, end, left_m, right_m, False, face.wall.sigma_m)
    for bare in parts.bare:
        start, end = _place(bare.start_ne_m), _place(bare.end_ne_m)
        yield Wall(start, end, NOMINAL_M / 2, NOMINAL_M / 2, False, bare.wall.sigma_m)


def _groups(pieces: Sequence[Wall], openings: Sequence[Opening]) -> list[list[Wall]]:
    """Pieces that are one wall."""
    if not pieces:
        return []
    are_one = [[_are_one(one, other, openings) for other in pieces] for one in pieces]
    number, labels = connected_components(np.array(are_one), directed=False)
    return [
        [piece for piece, its in zip(pieces, labels, strict=True) if its == label]
        for label in range(number)
    ]


def _are_one(one: Wall, other: Wall, openings: Sequence[Opening]) -> bool:
    """True if only a doorway, or nothing, is between two pieces in line."""
    other = _towards(other, one.along)
    start, end = one.of(other.start), one.of(other.end)
    is_in_line = (
        one.is_measured == other.is_measured
        and abs(end.imag - start.imag) < SAME_DIRECTION * other.length_m
        and max(abs(start.imag), abs(end.imag)) < OFF_LINE_M
        and abs(one.left_m - other.left_m) < AS_THICK_M
        and abs(one.right_m - other.right_m) < AS_THICK_M
    )
    if not is_in_line:
        return False
    gap_m = (one.length_m, start.real) if start.real > 0 else (end.real, 0.0)
    return gap_m[1] - gap_m[0] < SHORTEST_M or any(
        _fills(one, opening, gap_m) for opening in openings
    )


def _fills(wall: Wall, opening: Opening, gap_m: Vector2) -> bool:
    ends = sorted((wall.of(each) for each in _ends(opening)), key=lambda end: end.real)
    return all(
        abs(end.real - gap_end_m) < AT_DOORWAY_M and _off_m(wall, end) < AT_DOORWAY_M
        for end, gap_end_m in zip(ends, gap_m, strict=True)
    )


def _ends(opening: Opening) -> tuple[complex, complex]:
    return _place(opening.start_ne_m), _place(opening.end_ne_m)


def _off_m(wall: Wall, place: complex) -> float:
    """Distance of a place, relative to the wall's start, from the wall's body, across it."""
    return max(place.imag - wall.right_m, -wall.left_m - place.imag, 0.0)


def _towards(wall: Wall, along: complex) -> Wall:
    """The wall, turned round if it goes against a direction."""
    return wall if (wall.along * along.conjugate()).real > 0 else wall.turned_round()


def _joined(group: Sequence[Wall]) -> Wall:
    """One wall, with the mean line and thickness of its pieces by their lengths."""
    longest = max(group, key=lambda piece: piece.length_m)
    pieces = [_towards(piece, longest.along) for piece in group]
    lengths_m = [piece.length_m for piece in pieces]
    total = sum((piece.end - piece.start for piece in pieces), start=0j)
    along = total / abs(total)
    middles = [(piece.start + piece.end) / 2 for piece in pieces]
    middle = complex(np.average(middles, weights=lengths_m))
    ends_m = [
        ((end - middle) * along.conjugate()).real
        for piece in pieces
        for end in (piece.start, piece.end)
    ]
    return replace(
        longest,
        start=middle + min(ends_m) * along,
        end=middle + max(ends_m) * along,
        left_m=float(np.average([piece.left_m for piece in pieces], weights=lengths_m)),
        right_m=float(np.average([piece.right_m for piece in pieces], weights=lengths_m)),
        sigma_m=max(piece.sigma_m for piece in pieces),
    )


def _host(made: Sequence[Wall], opening: Opening) -> int | None:
    """Number of the wall that an opening is in or beside; None if there is none.

    First one on both sides of it, then one with a measured thickness, then the longest.
    """
    start, end = _ends(opening)
    along = (end - start) / abs(end - start)
    found = []
    for number, wall in enumerate(made):
        middle = wall.of((start + end) / 2)
        beyond_m = abs(middle.real - wall.length_m / 2) - wall.length_m / 2
        if (
            abs((along * wall.along.conjugate()).real) > ALONG_DOORWAY
            and _off_m(wall, middle) < AT_DOORWAY_M
            and beyond_m < opening.width_m / 2 + AT_DOORWAY_M
        ):
            found.append((beyond_m < 0, wall.is_measured, wall.length_m, number))
    return max(found)[-1] if found else None


def _beside_nothing(opening: Opening) -> Wall:
    """A wall as long as the opening."""
    start, end = _ends(opening)
    return Wall(start, end, NOMINAL_M / 2, NOMINAL_M / 2, False, opening.sigma_m)


def _with_doorway(wall: Wall, opening: Opening) -> Wall:
    """The wall with an opening, extended if it ends there."""
    start, end = _ends(opening)
    along_m = wall.of((start + end) / 2).real
    first_m = min(0.0, along_m - opening.width_m / 2)
    last_m = max(wall.length_m, along_m + opening.width_m / 2)
    doorways = (*wall.doorways, Doorway(opening, along_m))
    return replace(
        wall,
        start=wall.at(first_m),
        end=wall.at(last_m),
        doorways=tuple(replace(each, middle_m=each.middle_m - first_m) for each in doorways),
    )


def _closed(made: Sequence[Wall]) -> list[Wall]:
    """Walls that reach the lines of the walls that they end near to."""
    closed = []
    for wall in made:
        others = [other for other in made if other is not wall]
        first_m = min(_meets_m(wall, wall.turned_round(), others), key=abs, default=0.0)
        last_m = min(_meets_m(wall, wall, others), key=abs, default=0.0)
        if wall.length_m + first_m + last_m < SHORTEST_M:
            first_m = last_m = 0.0  # both ends would meet the same wall
        moved = (replace(each, middle_m=each.middle_m + first_m) for each in wall.doorways)
        closed.append(
            replace(
                wall,
                start=wall.at(-first_m),
                end=wall.at(wall.length_m + last_m),
                doorways=tuple(moved),
            )
        )
    return closed


def _meets_m(wall: Wall, towards: Wall, others: Sequence[Wall]) -> Iterator[float]:
    """Distances from the end of a wall to the lines of others, ahead of it or behind, m.

    `towards`: the wall, or the wall turned round for its other end.
    """
    taken_m = max(
        (
            towards.of(wall.at(each.middle_m)).real + each.opening.width_m / 2
            for each in wall.doorways
        ),
        default=0.0,
    )
    for other in others:
        crossing = _crossing(towards.start, towards.along, other.start, other.along)
        if crossing is None:
            continue
        ahead_m = towards.of(crossing).real - towards.length_m
        along_m = other.of(crossing).real
        is_on_it = -TOUCHING_M < along_m < other.length_m + TOUCHING_M
        if abs(ahead_m) < TOUCHING_M and is_on_it and towards.length_m + ahead_m >= taken_m:
            yield ahead_m


def _crossing(one: complex, along: complex, other: complex, its_along: complex) -> complex | None:
    """Where two lines cross; None if they are nearly parallel."""
    cross = (along.conjugate() * its_along).imag
    if abs(cross) < SAME_DIRECTION:
        return None
    return one + ((other - one).conjugate() * its_along).imag / cross * along


def _with_corners(made: Sequence[Wall]) -> Iterator[Wall]:
    """Walls with their corners: mitred where two walls end at the same place."""
    for wall in made:
        others = [other for other in made if other is not wall]
        right, left = _end_corners(wall, others)
        start_left, start_right = _end_corners(wall.turned_round(), others)
        yield replace(wall, corners=(start_left, start_right, right, left))


def _end_corners(wall: Wall, others: Sequence[Wall]) -> tuple[complex, complex]:
    """Right and left corner at the end of a wall."""
    right, left = wall.right_m * 1j * wall.along, -wall.left_m * 1j * wall.along
    for other, is_turned in product(others, (False, True)):
        ahead = other.turned_round() if is_turned else other
        if abs(ahead.start - wall.end) > TOUCHING_M / 100:
            continue
        its_right, its_left = ahead.right_m * 1j * ahead.along, -ahead.left_m * 1j * ahead.along
        ends = [
            end
            for own, its in ((right, its_right), (left, its_left))
            if (end := _crossing(wall.end + own, wall.along, ahead.start + its, ahead.along))
            is not None
        ]
        reach_m = MOST_MITRE * max(wall.thickness_m, ahead.thickness_m)
        if ends and all(abs(end - wall.end) < reach_m for end in ends):
            return ends[0], ends[1]
    return wall.end + right, wall.end + left
