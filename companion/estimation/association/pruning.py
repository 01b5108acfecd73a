"""What speaks for a wall, and what does not."""

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from companion.core.frames import wrap_rad
from companion.estimation.association.gating import MIN_COS_INCIDENCE, Candidates
from companion.estimation.association.merging import LARGEST_GAP_M, SAME_DIRECTION_RAD, fitted
from companion.estimation.association.straightness import bend, longer_side
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import (
    Array,
    Indices,
    Measured,
    Sightings,
    Unknowns,
    in_rows,
    reach_m,
)

MAX_WALLS = 400
"""Those worth most; more come only of odometry that drifts without end."""
STRETCH_M = 0.5
MAX_CUTS = 8
HIDES_M, MIN_HIDING, MAX_THROUGH_SHARE = 0.15, 3, 0.1
"""What hides a wall stands so far before it, and hardly a beam goes on behind the wall."""
GLIMPSE_KEYFRAMES, MIN_TOGETHER = 5, 4
"""A second to either side; a turning beam meets a metre of a wall so often in passing."""


@dataclass(frozen=True, slots=True)
class Support:
    """The least that speaks for a wall."""

    hits: int = 12
    extent_m: float = 0.35
    """From the first to the last of them along the wall."""
    worth: float = 60.0
    worth_a_hit: float = 2.0
    """By how much it lowers the χ² of all hits. Two lines through the noise of one wall lower it
    by about 1 for each hit."""
    normal_sigma_rad: float = math.radians(4)
    """How exactly they tell its direction, at worst: or it might turn anywhere."""
    gap_m: float = 1.2
    """Hits farther apart along a line than this do not show a new wall together."""
    opening_m: float = 0.4
    """There may be an opening where hits along a wall are farther apart than this."""

    def needed(self, hits: Array | Indices) -> Array:
        """The least worth of walls or pieces with so many hits each."""
        needed: Array = np.maximum(self.worth, self.worth_a_hit * hits)
        return needed


def one_wall_a_stretch(x: Unknowns, seen: Sightings, pairs: Candidates) -> Candidates:
    """Where two walls lie so close that a hit may be on either, it is on that which has more there.

    One of them would hide the other. A line that is nearly that of a wall takes a share of its hits
    wherever they come near to each other, and may live on those alone.
    """
    wall_of = pairs.best()
    may_be = np.zeros((pairs.hits, len(x.walls)), dtype=bool)
    may_be[pairs.hit, pairs.wall] = True
    for one, other in combinations(range(len(x.walls)), 2):
        if abs(wrap_rad(float(x.walls[one, 0] - x.walls[other, 0]))) > SAME_DIRECTION_RAD:
            continue
        either = np.flatnonzero(may_be[:, one] & may_be[:, other])
        if not len(either):
            continue
        stretch = np.floor(seen.points @ x.tangents[one] / STRETCH_M).astype(np.int64)
        stretch -= stretch.min()
        size = int(stretch.max()) + 1
        mine = np.bincount(stretch[wall_of == one], minlength=size)
        theirs = np.bincount(stretch[wall_of == other], minlength=size)
        at = stretch[either]
        may_be[either[mine[at] > theirs[at]], other] = False
        may_be[either[mine[at] < theirs[at]], one] = False
    return pairs.only(may_be[pairs.hit, pairs.wall])


def without_strays(x: Unknowns, seen: Sightings, pairs: Candidates, support: Support) -> Candidates:
    """Without hits far from the row of hits that a wall is worth most for.

    Another row must be worth it by itself, and the wall must go on to it behind what hides it, as
    behind a cupboard. Otherwise it is another wall: through two short pieces, as the returns of two
    corners, there is always a line, and not far from where a wall ends there often begins another;
    with a lever of metres that would turn the whole flight.
    """
    hit, wall, worth = pairs.worths()
    order, along, is_first = in_rows(x, seen.points[hit], wall, LARGEST_GAP_M)
    hit, wall, worth = hit[order], wall[order], worth[order]
    row = np.cumsum(is_first) - 1
    first = np.flatnonzero(is_first)
    last = np.append(first, len(hit))[1:] - 1
    of_row, low_m, high_m = wall[first], along[first], along[last]
    worths = np.bincount(row, worth, len(first))
    hits = np.bincount(row, minlength=len(first))
    main = np.full(len(x.walls), -1)
    upwards = np.argsort(worths, kind="stable")
    main[of_row[upwards]] = upwards
    stray = worths < support.needed(hits)
    for number in np.flatnonzero(~stray & (main[of_row] != np.arange(len(first)))):
        on = main[of_row[number]]
        gap_m = sorted((low_m[number], high_m[number], low_m[on], high_m[on]))[1:3]
        stray[number] = not _is_hidden(x, seen, int(of_row[number]), *gap_m)
    stray[main[main >= 0]] = False
    strayed = np.full(len(seen.points), NO_WALL)
    strayed[hit[stray[row]]] = wall[stray[row]]
    return pairs.only(strayed[pairs.hit] != pairs.wall)


def _is_hidden(x: Unknowns, seen: Sightings, wall: int, low_m: float, high_m: float) -> bool:
    """A stretch of a wall's line, from there to there along it: beams ended before it, not behind.

    Not if it has not been looked at.
    """
    cos = seen.beams @ x.normals[wall]
    before_m = x.walls[wall, 1] - seen.eyes @ x.normals[wall]
    towards = (before_m > 0) & (cos > MIN_COS_INCIDENCE)
    ahead_m = before_m[towards] / cos[towards]
    eyes, beams = seen.eyes[towards], seen.beams[towards]
    met_m = (eyes + ahead_m[:, None] * beams) @ x.tangents[wall]
    range_m = ((seen.points[towards] - eyes) * beams).sum(axis=1)
    inside = (met_m > low_m) & (met_m < high_m)
    ended = int((inside & (range_m < ahead_m - HIDES_M)).sum())
    went_on = int((inside & (range_m > ahead_m + HIDES_M)).sum())
    return ended >= MIN_HIDING and went_on <= MAX_THROUGH_SHARE * ended


def without_glimpses(m: Measured, pairs: Candidates) -> Candidates:
    """Without the hits that are nearly alone on their wall at their time.

    A wall that is in sight is met again and again. One hit that met something else, as at the
    corner behind which a wall begins, would tell where the drone is when nothing else does.
    """
    wall_of = pairs.best()
    hit = np.flatnonzero(wall_of != NO_WALL)
    key = wall_of[hit] * (int(m.frame.max(initial=0)) + 3 * GLIMPSE_KEYFRAMES) + m.frame[hit]
    in_order = np.sort(key)
    together = np.searchsorted(in_order, key + GLIMPSE_KEYFRAMES, side="right")
    together -= np.searchsorted(in_order, key - GLIMPSE_KEYFRAMES)
    alone = np.zeros(len(wall_of), dtype=bool)
    alone[hit[together < MIN_TOGETHER]] = True
    return pairs.only(~alone[pairs.hit])


def without_bends(
    x: Unknowns, seen: Sightings, sigma_m: Array, pairs: Candidates, known: int
) -> Candidates:
    """Walls cut where the hits on them bend away; what is cut off may show another wall."""
    wall_of = pairs.best()
    cut_off = np.full(len(wall_of), NO_WALL)
    for wall in range(known, len(x.walls)):
        mine: Indices = np.flatnonzero(wall_of == wall)
        for _ in range(MAX_CUTS):
            if len(mine) < 2:
                break
            along = seen.points[mine] @ x.tangents[wall]
            line = fitted(x.walls[wall], seen.points[mine], sigma_m[mine])
            across = seen.points[mine] @ (math.cos(line[0]), math.sin(line[0])) - line[1]
            bent = bend(along, across, sigma_m[mine])
            if bent.is_straight:
                break
            kept = longer_side(along, bent.at_m)
            cut_off[mine[~kept]] = wall
            mine = mine[kept]
    return pairs.only(cut_off[pairs.hit] != pairs.wall)


def worthy(
    x: Unknowns, seen: Sightings, sigma_m: Array, pairs: Candidates, support: Support, *, known: int
) -> tuple[Candidates, Indices]:
    """The walls that are worth having; the least worthy is taken out first, then all is redone."""
    kept = np.arange(len(x.walls))
    while len(kept) > known:
        _, wall, worth = pairs.worths()
        hits = np.bincount(wall, minlength=len(x.walls)).astype(float)
        worths = np.bincount(wall, worth, len(x.walls)) / support.needed(hits)
        wall_of = pairs.best()
        low_m, high_m = reach_m(x, seen.points, wall_of).T
        vague = _normal_sigma_rad(x, seen, sigma_m, wall_of) > support.normal_sigma_rad
        worths[(hits < support.hits) | (high_m - low_m < support.extent_m) | vague] = 0.0
        judged = kept[kept >= known]
        least = judged[int(worths[judged].argmin())]
        if worths[least] >= 1 and len(kept) <= MAX_WALLS:
            break
        gone = judged[worths[judged] <= 0] if worths[least] <= 0 else np.array([least])
        kept = np.setdiff1d(kept, gone)
        pairs = pairs.only(~np.isin(pairs.wall, gone))
    return pairs, kept


def _normal_sigma_rad(x: Unknowns, seen: Sightings, sigma_m: Array, wall_of: Indices) -> Array:
    """(w,): how exactly the hits on each wall tell its direction, where they are right."""
    hit = np.flatnonzero(wall_of != NO_WALL)
    wall, weight = wall_of[hit], sigma_m[hit] ** -2.0
    along_m = (seen.points[hit] * x.tangents[wall]).sum(axis=1)
    count = len(x.walls)
    total = np.maximum(np.bincount(wall, weight, count), 1e-9)
    arm_m = along_m - (np.bincount(wall, weight * along_m, count) / total)[wall]
    spread = np.bincount(wall, weight * arm_m**2, count)
    sigma_rad: Array = 1 / np.sqrt(np.maximum(spread, 1e-9))
    return sigma_rad
