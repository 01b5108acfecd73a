"""Finds where a flight began from its walls and free space alone, over the full circle.

Two walls that are not parallel place a flight: their direction gives the heading, their offsets the
position. So each pair of walls of the flight, on each pair of walls of the map, proposes a start.
Starts that many pairs propose are refined (`placement.py`) and compared by all walls and by the
free space (`evidence.py`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import moved, wrap_rad
from companion.estimation.placement import refined_start
from companion.estimation.smoothing.state import YAW
from companion.survey.evidence import Evidence, Sight, evidence

MAX_PIECES = 24
"""Longest pieces of wall of each map that propose starts. Chosen: 166 000 pairs of pairs."""
MAX_TURN_APART_RAD = math.radians(6)
"""Largest difference of the headings that two walls propose, rad. Chosen: their errors."""
MIN_SIN_BETWEEN = 0.5
"""Sine of the least angle between two walls that propose a start. Chosen: 30°."""
CELL_M, CELL_RAD = 0.5, math.radians(10)
"""Starts within such a cell, m and rad, are one proposal. Chosen: what a refinement corrects."""
MAX_PROPOSALS, MAX_REFINED = 1500, 40
"""Most proposals that are compared, and most that are refined. Chosen."""
DISTINCT_M, DISTINCT_RAD = 0.5, math.radians(15)
"""Starts that differ less in position, m, and in heading, rad, are the same. Chosen."""
CONTRADICTION = 3.0
"""Metres of agreement that a metre of contradiction outweighs. Chosen."""
MIN_SHARED_WALLS = 4
"""Least walls that must fit. Chosen: any corner of two walls fits any other."""
MIN_ACROSS_M = 2.0
"""Least agreement across any direction, m. Chosen: along a corridor its ends must fit."""
MAX_CONTRADICTED_SHARE = 0.02
"""Largest contradiction relative to the agreement. Measured with 580 pairs of flights in 15 worlds:
at most 0.01 at the right start. In flights through different rooms the best start with four walls
has at least 0.034, or another start fits equally."""
EQUAL_SHARE = 0.08
"""Starts whose scores differ by less than this share fit equally. Measured with the same pairs: the
equal starts of a symmetric room differ by at most 3 %; in a room that one alcove tells from a
symmetric one the wrong start scores at least 11 % less than the right one, and in three rooms
without any symmetry at least 42 % less."""
MAX_NAMED = 4
"""Most starts named in a reason. Chosen."""
FOUND_SIGMA = np.array([1.0, 1.0, math.radians(10)])
"""Sigmas of a found start in the joint solution: north, east, m, and heading, rad. Chosen: the
walls decide."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A possible start, and what speaks for it."""

    start: Array
    """(3,): north, east, m, and heading, rad, in the frame of the map."""
    agreed_m: float
    contradicted_m: float
    shared_walls: int
    across_m: float
    """As in `Evidence`."""

    @property
    def score_m(self) -> float:
        """Metres of wall that agree, less those that contradict, with their weight."""
        return self.agreed_m - CONTRADICTION * self.contradicted_m


@dataclass(frozen=True, slots=True)
class StartSearch:
    """Result of a search: possible starts, and whether one of them is certain."""

    candidates: tuple[Candidate, ...]
    """The best first."""

    @property
    def found(self) -> Candidate | None:
        """The only start that fits; None if none or several fit."""
        return self.candidates[0] if self._fits and len(self._equal) == 1 else None

    @property
    def lead_m(self) -> float:
        """Lead of the best start over the second, in metres of wall."""
        scores_m = [*(each.score_m for each in self.candidates[:2]), 0.0, 0.0]
        return scores_m[0] - max(scores_m[1], 0.0)

    @property
    def reason(self) -> str:
        """Why no start is certain."""
        if not self.candidates or self.candidates[0].shared_walls < MIN_SHARED_WALLS:
            most = max((each.shared_walls for each in self.candidates), default=0)
            return (
                f"too little overlap: {min(most, MIN_SHARED_WALLS - 1)} of its walls fit the map "
                f"together; a start needs {MIN_SHARED_WALLS}"
            )
        best = self.candidates[0]
        if best.across_m < MIN_ACROSS_M:
            return (
                f"too little overlap: across one direction {best.across_m:.1f} m of wall fit; "
                f"a start needs {MIN_ACROSS_M:.1f} m"
            )
        if not self._fits:
            return (
                f"no start fits: the best, {text(best.start)}, contradicts "
                f"{best.contradicted_m:.1f} m of wall and fits {best.agreed_m:.1f} m"
            )
        starts = "; ".join(text(each.start) for each in self._equal[:MAX_NAMED])
        more = len(self._equal) - MAX_NAMED
        return f"{len(self._equal)} starts fit equally: {starts}" + (
            f"; and {more} more" if more > 0 else ""
        )

    def score_m(self, start: Array) -> float:
        """Score of the candidate that is the same as a start (3,); -inf if there is none."""
        scores_m = (each.score_m for each in self.candidates if is_same(each.start, start))
        return next(scores_m, -math.inf)

    @property
    def _fits(self) -> bool:
        """The best start shares enough with the map, and next to nothing contradicts it."""
        if not self.candidates:
            return False
        best = self.candidates[0]
        return (
            best.shared_walls >= MIN_SHARED_WALLS
            and best.across_m >= MIN_ACROSS_M
            and best.contradicted_m <= MAX_CONTRADICTED_SHARE * best.agreed_m
        )

    @property
    def _equal(self) -> tuple[Candidate, ...]:
        """The best start and those that fit about as well."""
        least_m = (1 - EQUAL_SHARE) * self.candidates[0].score_m
        return tuple(each for each in self.candidates if each.score_m >= least_m)


def search_start(flight: Sight, known: Sight, refuted: Sequence[Array] = ()) -> StartSearch:
    """Search the start of a flight in the frame of the known map, except refuted starts (3,)."""
    possible = candidates(flight, known)
    return StartSearch(
        tuple(each for each in possible if not any(is_same(each.start, other) for other in refuted))
    )


def candidates(flight: Sight, known: Sight) -> list[Candidate]:
    """Possible starts of a flight in the frame of the known map, the best first."""
    proposals = _proposals(flight, known)
    if not len(proposals):
        return []
    compared = _scored(proposals, evidence(flight, known, proposals))
    of_flight, of_known = flight.as_unknowns(), known.as_unknowns()
    refined = np.array(
        [
            refined_start(of_flight, of_known, each.start, FOUND_SIGMA)
            for each in _distinct(compared)[:MAX_REFINED]
        ]
    )
    return _distinct(_scored(refined, evidence(flight, known, refined)))


def _proposals(flight: Sight, known: Sight) -> Array:
    """(h, 3): starts that pairs of walls propose, those of the longest walls first."""
    ours, theirs = _longest(flight), _longest(known)
    one, other = (each.ravel() for each in np.meshgrid(ours, theirs, indexing="ij"))
    yaw_rad = wrap_rad(known.walls[other, 0] - flight.walls[one, 0])
    weight_m = np.minimum(np.ptp(flight.reach_m, axis=1)[one], np.ptp(known.reach_m, axis=1)[other])
    first, second = np.triu_indices(len(one), 1)
    apart_rad = wrap_rad(yaw_rad[second] - yaw_rad[first])
    sin_between = np.sin(known.walls[other[second], 0] - known.walls[other[first], 0])
    fits = (np.abs(apart_rad) < MAX_TURN_APART_RAD) & (np.abs(sin_between) > MIN_SIN_BETWEEN)
    first, second, apart_rad = first[fits], second[fits], apart_rad[fits]
    weight_m = np.minimum(weight_m[first], weight_m[second])
    shift_m = known.walls[other, 1] - flight.walls[one, 1]
    normals = np.stack([known.normals[other[first]], known.normals[other[second]]], axis=1)
    place = np.linalg.solve(normals, np.stack([shift_m[first], shift_m[second]], axis=1)[..., None])
    starts = np.column_stack([place[..., 0], yaw_rad[first] + 0.5 * apart_rad])
    return _clustered(starts, weight_m)


def _longest(sight: Sight) -> Indices:
    return np.argsort(-np.ptp(sight.reach_m, axis=1), kind="stable")[:MAX_PIECES]


def _clustered(starts: Array, weight: Array) -> Array:
    """(h, 3): means of the starts in one cell each, the heaviest first."""
    turned = wrap_rad(starts[:, YAW])
    cells = np.rint(np.column_stack([starts[:, :YAW] / CELL_M, turned / CELL_RAD]))
    cells[:, YAW] %= round(math.tau / CELL_RAD)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    cell = cell.ravel()
    total = np.bincount(cell, weight)
    columns = (*starts[:, :YAW].T, np.cos(turned), np.sin(turned))
    north, east, cos, sin = (np.bincount(cell, weight * each) / total for each in columns)
    means = np.column_stack([north, east, np.arctan2(sin, cos)])
    return means[np.argsort(-total, kind="stable")[:MAX_PROPOSALS]]


def _scored(starts: Array, found: Evidence) -> list[Candidate]:
    """Candidates, the best first."""
    scored = [
        Candidate(start, *row)
        for start, *row in zip(
            starts,
            found.agreed_m.tolist(),
            found.contradicted_m.tolist(),
            found.shared_walls.tolist(),
            found.across_m.tolist(),
            strict=True,
        )
    ]
    return sorted(scored, key=lambda each: -each.score_m)


def _distinct(ordered: list[Candidate]) -> list[Candidate]:
    """Only the best of those candidates that are the same."""
    distinct: list[Candidate] = []
    for each in ordered:
        if not any(is_same(each.start, other.start) for other in distinct):
            distinct.append(each)
    return distinct


def is_same(one: Array, other: Array) -> bool:
    """True if two starts differ by less than what makes them distinct."""
    north_m, east_m, turn_rad = (one - other).tolist()
    return math.hypot(north_m, east_m) < DISTINCT_M and abs(wrap_rad(turn_rad)) < DISTINCT_RAD


def different_places(possible: Sequence[Candidate], flight: Sight, score_m: float) -> list[Array]:
    """(2,) each: where the middle of a flight lies for all starts whose score is about `score_m`.

    The same room turned is the same place.
    """
    places: list[Array] = []
    for each in possible:
        north_m, east_m, yaw_rad = each.start.tolist()
        place = np.array(moved((north_m, east_m), flight.middle_ne_m, yaw_rad))
        is_new = all(float(np.hypot(*(place - other))) > flight.radius_m for other in places)
        if is_new and each.score_m >= (1 - EQUAL_SHARE) * score_m:
            places.append(place)
    return places


def text(start: Array) -> str:
    """A start (3,) for a reader."""
    north_m, east_m, yaw_rad = start.tolist()
    return (
        f"{abs(north_m):.1f} m {'north' if north_m >= 0 else 'south'}, "
        f"{abs(east_m):.1f} m {'east' if east_m >= 0 else 'west'}, "
        f"heading {math.degrees(wrap_rad(yaw_rad)):+.0f}°"
    )
