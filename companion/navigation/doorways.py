"""Finds doorways on a path, measures their width and routes the path through them at right angles.

At an angle, a doorway is narrower by the cosine of that angle, and the drone passes nearer to one
jamb. So the path leads to a place before the doorway, and straight to a place after it:

         jamb █
    before ─────► after
         jamb █

Doorways are stored: from the other side, or later, the jambs may not stand out on the map. The
cells of the map resolve the width to two cells. A sweep of the front beam over both jambs measures
it to centimetres.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from companion.core.frames import Vector2
from companion.core.values import value
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.navigation.grid_planner import CostGrid
from companion.navigation.path_follower import Way

DOORWAY_ROOM_M = 0.7
"""A path with less clearance than this passes a doorway or a similar place, m. Chosen."""
JAMBS_WITHIN_M = 1.0
"""Jambs are searched within this distance of a place on the path, m. Chosen."""
MIN_WIDTH_M = 0.80
"""Minimum measured width of an opening that the drone enters, m. The width is measured between the
innermost detections on the jambs, with noise. A doorway of 0.9 m measures 0.82 to 0.89 m in
flights."""
LOOKS = 2
"""Number of sweeps before an opening is refused. Chosen: while the drone turns, its pose may drift
by 0.1 m."""
JAMB_DEEP_M = 0.3
"""Detections within this distance of the line between the jambs belong to a jamb, m. Chosen."""
SAME_WITHIN_M = 0.8
"""Doorways whose middles are nearer than this are the same doorway, m. Chosen."""
OPPOSITE_COS = -0.5
"""Jambs are opposite if the cosine of the angle between them is below this. Chosen."""
AWAY_M = 0.7
"""Distance before and after a doorway's middle where the drone is clear of its wall and has room to
turn, m. Chosen."""


@value
class Doorway:
    """A narrow place with an obstacle on both sides. Positions are local NED, m."""

    leg: int
    """Index of the path's next corner after the doorway."""
    middle_ne_m: Vector2
    through_ne: Vector2
    """Unit vector at a right angle to the line between the jambs, in the direction of passage."""
    half_m: float
    """Distance from the middle to either jamb, m."""
    swept_s: float = -math.inf
    """Time of the last sweep of the front beam over both jambs, s."""
    widths_m: tuple[float, ...] = ()
    """Widths from the last `LOOKS` sweeps, m; NaN for a sweep that did not detect both jambs."""

    @property
    def is_too_narrow(self) -> bool:
        """True if `LOOKS` sweeps were done and none was wide enough: the drone must not enter."""
        return len(self.widths_m) == LOOKS and self.looks_narrow

    @property
    def looks_narrow(self) -> bool:
        """True if at least one sweep measured a width, and none measured `MIN_WIDTH_M` or more."""
        met_m = [width_m for width_m in self.widths_m if math.isfinite(width_m)]
        return bool(met_m) and max(met_m) < MIN_WIDTH_M

    def at_m(self, along_m: float, aside_m: float = 0.0) -> Vector2:
        """Place at a distance after the middle (negative: before), and aside to the right, m."""
        (north, east), (x, y) = self.middle_ne_m, self.through_ne
        return north + along_m * x - aside_m * y, east + along_m * y + aside_m * x

    def jambs_ne_m(self) -> tuple[Vector2, Vector2]:
        """Left and right jamb, in the direction of passage."""
        return self.at_m(0.0, -self.half_m), self.at_m(0.0, self.half_m)

    def along_m(self, place_ne_m: Vector2) -> float:
        """Distance of a place past the middle, m."""
        return (place_ne_m[0] - self.middle_ne_m[0]) * self.through_ne[0] + (
            place_ne_m[1] - self.middle_ne_m[1]
        ) * self.through_ne[1]

    def aside_m(self, place_ne_m: Vector2) -> float:
        """Distance of a place to the right of the middle line, m."""
        return (place_ne_m[1] - self.middle_ne_m[1]) * self.through_ne[0] - (
            place_ne_m[0] - self.middle_ne_m[0]
        ) * self.through_ne[1]

    def measured(self, met_ne_m: Sequence[Vector2]) -> "Doorway":
        """The doorway with the width from one sweep. `met_ne_m`: its detections, local NED, m."""
        jambs = [at for at in met_ne_m if abs(self.along_m(at)) < JAMB_DEEP_M]
        aside_m = [self.aside_m(at) for at in jambs]
        right_m = min((m for m in aside_m if m > 0), default=math.nan)
        left_m = max((m for m in aside_m if m <= 0), default=math.nan)
        return replace(self, widths_m=(right_m - left_m,))

    def is_same(self, other: "Doorway") -> bool:
        return math.dist(self.middle_ne_m, other.middle_ne_m) < SAME_WITHIN_M

    def towards(self, place_ne_m: Vector2) -> Vector2:
        """Unit vector through the doorway, to the side of a place."""
        sign = math.copysign(1.0, self.along_m(place_ne_m))
        return sign * self.through_ne[0], sign * self.through_ne[1]

    def is_between(self, start: Vector2, end: Vector2) -> bool:
        """True if the straight line between two places crosses the doorway between its jambs."""
        before_m, after_m = self.along_m(start), self.along_m(end)
        if before_m * after_m >= 0:
            return False
        share = before_m / (before_m - after_m)
        at = start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
        return math.dist(at, self.middle_ne_m) < self.half_m


def find_doorways(ground: CostGrid, here: Vector2, way: Way) -> tuple[Doorway, ...]:
    """Doorways at the narrowest place of each narrow stretch of the path."""
    narrowest: list[tuple[int, Vector2, Vector2]] = []
    least_m = math.inf
    for leg, place, heading in _along(here, way):
        room_m = ground.clear_m(place)
        if room_m >= DOORWAY_ROOM_M:
            least_m = math.inf
            continue
        if math.isinf(least_m):
            narrowest.append((leg, place, heading))
        elif room_m < least_m:
            narrowest[-1] = leg, place, heading
        least_m = min(room_m, least_m)
    found = (_doorway(ground, *one) for one in narrowest)
    return tuple(doorway for doorway in found if doorway is not None)


def remembered(known: Sequence[Doorway], found: Sequence[Doorway]) -> tuple[Doorway, ...]:
    """Merges newly found doorways into the known ones. Keeps sweep times and widths."""
    new = []
    for doorway in found:
        same = [old for old in known if old.is_same(doorway)]
        swept_s = max((doorway.swept_s, *(old.swept_s for old in same)))
        before_m = next((old.widths_m for old in same if old.widths_m), ())
        widths_m = (*before_m, *doorway.widths_m)[-LOOKS:]
        new.append(replace(doorway, swept_s=swept_s, widths_m=widths_m))
    kept = (old for old in known if not any(old.is_same(doorway) for doorway in new))
    return (*kept, *new)


def on_the_way(
    known: Sequence[Doorway], found: Sequence[Doorway], here: Vector2, way: Way
) -> tuple[Doorway, ...]:
    """Doorways found on the path, and known doorways that the path crosses, in its order."""
    legs = list(pairwise((here, *way)))
    passed = list(found)
    for leg, (start, end) in enumerate(legs):
        passed += [
            replace(doorway, leg=leg, through_ne=doorway.towards(end))
            for doorway in known
            if doorway.is_between(start, end) and not any(map(doorway.is_same, found))
        ]

    def order(doorway: Doorway) -> tuple[int, float]:
        return doorway.leg, math.dist(legs[doorway.leg][0], doorway.middle_ne_m)

    return tuple(sorted(passed, key=order))


def too_narrow(known: Sequence[Doorway], grid: Occupancy) -> tuple[Doorway, ...]:
    """Known doorways that the drone must not enter.

    Doorways that it passed before they were measured are not among them.
    """
    narrow = (doorway for doorway in known if doorway.is_too_narrow)
    return tuple(doorway for doorway in narrow if not _came_through(doorway, grid))


def _came_through(doorway: Doorway, grid: Occupancy) -> bool:
    row, column = grid.cell(doorway.middle_ne_m)
    rows, columns = (slice(max(at - 3, 0), max(at + 4, 0)) for at in (row, column))
    return bool(grid.flown[rows, columns].any())


def with_shut(ground: CostGrid, doorways: Sequence[Doorway]) -> CostGrid:
    """The cost grid with the doorways shut as by walls, except in the drone's own cell."""
    if not doorways:
        return ground
    passable, cost = ground.passable.copy(), ground.cost.copy()
    for doorway in doorways:
        reach_m = doorway.half_m + CELL_M
        for aside_m in np.arange(-reach_m, reach_m, CELL_M / 2).tolist():
            for along_m in (-CELL_M, 0.0, CELL_M):  # paths have diagonal steps, too
                cell = ground.grid.cell(doorway.at_m(along_m, aside_m))
                if ground.grid.has(cell) and cell != ground.start:
                    passable[cell], cost[cell] = False, np.inf
    return replace(ground, passable=passable, cost=cost)


def passed_squarely(ground: CostGrid, here: Vector2, way: Way, doorways: Sequence[Doorway]) -> Way:
    """The path, routed through the doorways' middles at right angles.

    A doorway is left as planned if the drone does not fit along that route. In a corridor as narrow
    as a doorway, a right angle to two cells of its walls may point at a wall.
    """
    squared: Way = way
    straight: tuple[Doorway, ...] = ()
    planned = set(pairwise((here, *way)))
    for doorway in doorways:
        tried = _routed(here, way, (*straight, doorway))
        new = set(pairwise((here, *tried))) - planned
        if all(ground.fits_along(*leg) for leg in new):
            squared, straight = tried, (*straight, doorway)
    return squared


def _routed(here: Vector2, way: Way, doorways: Sequence[Doorway]) -> Way:
    """The path by a place before and one after each doorway, without its corners near them.

    Where doorways are so near that these places overlap, the path never leads back.
    """
    routed: list[Vector2] = []
    for leg, corner in enumerate(way):
        is_last = leg == len(way) - 1
        for doorway in doorways:
            if doorway.leg == leg:
                from_m = doorway.along_m(routed[-1] if routed else here)
                to_m = doorway.along_m(corner) if is_last else math.inf
                ends_m = (m for m in (-AWAY_M, AWAY_M) if from_m < m < to_m)
                routed += [doorway.at_m(along_m) for along_m in ends_m]
        if is_last or all(math.dist(corner, d.middle_ne_m) > AWAY_M for d in doorways):
            routed.append(corner)
    return tuple(routed)


def _along(here: Vector2, way: Way) -> Iterator[tuple[int, Vector2, Vector2]]:
    """Places along the path, one cell apart, each with its leg and the leg's direction."""
    start = here
    for leg, corner in enumerate(way):
        length_m = math.dist(start, corner)
        heading = (corner[0] - start[0], corner[1] - start[1])
        for share in np.linspace(0, 1, max(1, round(length_m / CELL_M))).tolist():
            yield leg, (start[0] + share * heading[0], start[1] + share * heading[1]), heading
        start = corner


def _doorway(ground: CostGrid, leg: int, place: Vector2, heading: Vector2) -> Doorway | None:
    """Doorway between the nearest obstacle and the nearest one on the opposite side.

    Returns None if there is no such pair, or if the two are too far apart.
    """
    met, _ = ground.grid.met_near(place, JAMBS_WITHIN_M)
    jambs = met - place
    away_m = np.hypot(*jambs.T)
    if not len(jambs) or away_m.min() < 0.5 * CELL_M:
        return None
    nearest = jambs[away_m.argmin()]
    cos_between = jambs @ nearest / (away_m * away_m.min())
    opposite = jambs[cos_between < OPPOSITE_COS]
    if not len(opposite):
        return None
    other = opposite[np.hypot(*opposite.T).argmin()]
    middle, across = 0.5 * (nearest + other), other - nearest
    if math.hypot(*across) > 2 * DOORWAY_ROOM_M:
        return None
    through = np.array([-across[1], across[0]]) / math.hypot(*across)
    through *= 1.0 if through @ heading >= 0 else -1.0
    return Doorway(
        leg,
        (place[0] + float(middle[0]), place[1] + float(middle[1])),
        (float(through[0]), float(through[1])),
        0.5 * math.hypot(*across),
    )
