"""Measures how far the walls and free space of two maps agree, for assumed starts.

A start (north, east, yaw) is where one map's origin lies in the frame of the other. Each beam that
ended on a wall of one map is compared with the walls of the other:

    agrees        it ends on a wall that faces the same way
    contradicts   it passed through a wall
    neither       it ends where the other map has no wall

Both maps are asked, so a wall in the free space of the other counts in either case. Hits of one
stretch of wall have common errors. So agreement and contradiction are counted in metres of wall,
however many hits there are.
"""

from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2, inverse_starts
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import (
    CALIBRATION_SIZE,
    POSE_SIZE,
    YAW,
    Rays,
    Unknowns,
    in_rows,
    normals_of,
    tangents_of,
)

OPENING_M = 0.4
"""A larger gap between hits along a wall may be an opening, m. Chosen, as in `Support`."""
MIN_PIECE_M = 0.3
"""Least length of a piece of wall, m. Chosen: a shorter one has no certain direction."""
STRETCH_M = 0.5
"""Greatest length of a stretch of wall that is represented by a few beams, m. Chosen."""
BEAMS_PER_STRETCH = 3
"""Beams that represent a stretch. Chosen: a few hundred beams for a room."""
WALL_SIGMA_M = 0.08
"""Error of a wall within its map, m. Chosen, as in `placement.py`."""
GATE_SIGMAS = 3.0
"""A beam agrees with a wall up to this many sigmas, and passed through it beyond. Chosen."""
BEYOND_END_M = 0.2
"""A piece of wall explains hits this far beyond its ends, m. Chosen."""
BEFORE_END_M = 0.2
"""Beams that pass this near to an end of a piece do not contradict it, m. Chosen."""
MIN_COS_FACING = np.cos(np.radians(15))
"""Cosine of the largest angle between walls that may be the same. Chosen."""
SHARED_M = 0.8
"""Least length of a wall that agrees for the wall to count as shared, m. Chosen."""
CELLS_AT_ONCE = 400_000
"""Starts times beams times pieces evaluated together; bounds the memory. Chosen."""


@dataclass(frozen=True, slots=True)
class Sight:
    """Walls and beams of a map: p straight pieces of wall, and n beams that ended on walls."""

    walls: Array
    """(p, 2): direction of each piece's normal, towards the wall, and offset of its line."""
    reach_m: Array
    """(p, 2): its interval along (-sin, cos)(normal)."""
    origins: Array
    """(n, 2): positions of the drone."""
    points: Array
    """(n, 2): ends of the beams."""
    wall: Indices
    """(n,): number of the wall that each beam ended on."""
    facing: Array
    """(n, 2): its unit normal."""
    sigma_m: Array
    """(n,): sigma of each end across its wall, with the error of the wall."""
    weight_m: Array
    """(n,): length of wall that each beam represents."""

    @property
    def normals(self) -> Array:
        """(p, 2): unit normals of the pieces."""
        return normals_of(self.walls)

    @property
    def tangents(self) -> Array:
        """(p, 2): unit vectors along the pieces."""
        return tangents_of(self.walls)

    @property
    def length_m(self) -> float:
        """Length of all pieces, m."""
        return float(np.ptp(self.reach_m, axis=1).sum())

    def as_unknowns(self) -> Unknowns:
        """The walls alone."""
        none = np.empty((0, POSE_SIZE)), np.empty((0, CALIBRATION_SIZE))
        return Unknowns(none[0], self.walls, self.reach_m, none[1])

    @property
    def middle_ne_m(self) -> Vector2:
        """Mean of the ends of its beams, north and east."""
        north_m, east_m = self.points.mean(axis=0).tolist()
        return north_m, east_m

    @property
    def radius_m(self) -> float:
        """Root mean square distance of the ends of its beams from their middle, m."""
        return float(np.sqrt(((self.points - self.middle_ne_m) ** 2).sum(axis=1).mean()))

    @classmethod
    def of(cls, x: Unknowns, rays: Rays, sigma_m: Array, wall_of: Indices) -> "Sight":
        """What hits on walls show: n rays with the sigma of their range and their wall."""
        hit = np.flatnonzero(wall_of != NO_WALL)
        order, along_m, is_first = in_rows(x, rays.points[hit], wall_of[hit], OPENING_M)
        hit, first, row = hit[order], np.flatnonzero(is_first), np.cumsum(is_first) - 1
        last = np.append(first[1:], len(hit))[: len(first)] - 1
        reach_m = np.column_stack([along_m[first], along_m[last]])
        is_long = np.ptp(reach_m, axis=1) >= MIN_PIECE_M
        walls, reach_m = x.walls[wall_of[hit[first[is_long]]]], reach_m[is_long]
        on_long = is_long[row]
        piece = (np.cumsum(is_long) - 1)[row[on_long]]
        chosen, weight_m = _representatives(piece, along_m[on_long], reach_m)
        hit = hit[on_long][chosen]
        facing = x.normals[wall_of[hit]]
        across_m = sigma_m[hit] * (rays.beams[hit] * facing).sum(axis=1)
        _, wall = np.unique(wall_of[hit], return_inverse=True)
        return cls(
            walls,
            reach_m,
            rays.origins[hit],
            rays.points[hit],
            wall,
            facing,
            np.hypot(across_m, WALL_SIGMA_M),
            weight_m,
        )


@dataclass(frozen=True, slots=True)
class Evidence:
    """How far two maps agree, for h starts; in metres of wall, the mean of both maps."""

    agreed_m: Array
    """(h,): walls of one map on walls of the other; in full where they coincide, less if they are
    some sigmas apart."""
    contradicted_m: Array
    """(h,): walls of one map whose beams passed through walls of the other."""
    shared_walls: Indices
    """(h,): walls that agree in at least `SHARED_M`."""
    across_m: Array
    """(h,): what agrees across the direction in which least does. Two parallel walls do not
    determine a place along them: then it is zero."""


def evidence(one: Sight, other: Sight, starts: Array) -> Evidence:
    """Compare two maps for starts (h, 3) of `one` in the frame of `other`."""
    there = _of_beams(one, other, starts)
    back = _of_beams(other, one, inverse_starts(starts))
    agreed_m, contradicted_m = (0.5 * (there[i] + back[i]) for i in range(2))
    shared = np.minimum(there[3], back[3]).astype(np.int64)
    return Evidence(agreed_m, contradicted_m, shared, np.minimum(there[2], back[2]))


def _of_beams(one: Sight, other: Sight, starts: Array) -> tuple[Array, Array, Array, Array]:
    """(h,) each: what the beams of `one` find agreed, contradicted, and agreed across, m."""
    agreed_m, contradicted_m, across_m, shared = (np.zeros(len(starts)) for _ in range(4))
    is_on = one.wall[:, None] == np.arange(one.wall.max(initial=-1) + 1)
    step = max(1, CELLS_AT_ONCE // max(1, len(one.points) * len(other.walls)))
    for low in range(0, len(starts) if len(other.walls) else 0, step):
        part = slice(low, low + step)
        agrees, contradicts, facing = _compare(one, other, starts[part])
        on_walls_m = agrees * one.weight_m
        agreed_m[part], contradicted_m[part] = on_walls_m.sum(axis=1), contradicts @ one.weight_m
        shared[part] = (on_walls_m @ is_on >= SHARED_M).sum(axis=1)
        scatter = np.einsum("hn,hni,hnj->hij", on_walls_m, facing, facing)
        across_m[part] = np.linalg.eigvalsh(scatter)[:, 0]
    return agreed_m, contradicted_m, across_m, shared


def _compare(one: Sight, other: Sight, starts: Array) -> tuple[Array, Mask, Array]:
    """(h, n) each: agreement 0 to 1 of each beam, contradiction; (h, n, 2): its wall's normal."""
    cos, sin = np.cos(starts[:, YAW]), np.sin(starts[:, YAW])
    turn = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)
    origins, points, facing = (each @ turn for each in (one.origins, one.points, one.facing))
    origins, points = origins + starts[:, None, :YAW], points + starts[:, None, :YAW]
    from_m, to_m = (ends @ other.normals.T - other.walls[:, 1] for ends in (origins, points))
    along_m = points @ other.tangents.T
    low_m, high_m = other.reach_m.T
    sigma_m = one.sigma_m[:, None]
    meets = (np.abs(to_m) < GATE_SIGMAS * sigma_m) & (facing @ other.normals.T > MIN_COS_FACING)
    meets &= (along_m > low_m - BEYOND_END_M) & (along_m < high_m + BEYOND_END_M)
    misfit = np.where(meets, to_m / (GATE_SIGMAS * sigma_m), 1.0)
    agrees = 1 - (misfit**2).min(axis=2)
    crosses = ((from_m < 0) != (to_m < 0)) & (np.abs(to_m) > GATE_SIGMAS * sigma_m)
    crosses &= np.abs(from_m) > GATE_SIGMAS * WALL_SIGMA_M
    share = from_m / np.where(crosses, from_m - to_m, 1.0)
    met_m = origins @ other.tangents.T
    met_m = met_m + share * (along_m - met_m)
    crosses &= (met_m > low_m + BEFORE_END_M) & (met_m < high_m - BEFORE_END_M)
    contradicts = crosses.any(axis=2) & ~meets.any(axis=2)
    return agrees, contradicts, facing


def _representatives(piece: Indices, along_m: Array, reach_m: Array) -> tuple[Indices, Array]:
    """A few of the hits (n,) of each stretch, and the length that each represents.

    `piece`, `along_m` (n,): piece of each hit, in order, and position along it.
    """
    length_m = np.ptp(reach_m, axis=1)
    stretches = np.ceil(length_m / STRETCH_M).astype(np.int64)
    share = (along_m - reach_m[piece, 0]) / length_m[piece]
    within = np.minimum((share * stretches[piece]).astype(np.int64), stretches[piece] - 1)
    stretch = (np.cumsum(stretches) - stretches)[piece] + within
    count = np.bincount(stretch, minlength=int(stretches.sum()))
    rank = np.arange(len(stretch)) - (np.cumsum(count) - count)[stretch]
    chosen = np.minimum(count, BEAMS_PER_STRETCH)[stretch]
    quota = rank * chosen // np.maximum(count[stretch], 1)
    is_chosen = quota != (rank - 1) * chosen // np.maximum(count[stretch], 1)
    weight_m = (length_m / stretches)[piece] / chosen
    return np.flatnonzero(is_chosen), weight_m[is_chosen]
