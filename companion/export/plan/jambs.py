"""Measures the width of a doorway from the ranges that ended near its jambs.

    wall ▒▒▒▒▒▒▒▒·▒·  ·            hits of the wall, with their noise
                 ▒·                hits of its end, as thick as the wall
                 └ jamb

The last hit of a wall lies beyond its jamb by some sigmas. So the place of a jamb is the most
likely end of a row of hits that are spread evenly along the wall, and of which a share lies on its
end: slanted beams through the doorway meet that. All have the noise of their ranges and bearings. A
few of them belong to something else.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.messages import FloorPlan, WallSegment
from companion.export.rays import eyes_xy_m

if TYPE_CHECKING:
    from companion.export.plan.survey import Opening

BEARING_RAD, POSE_M = math.radians(1), 0.02
"""Sigma of a beam's bearing, rad, and of the drone's place along the wall, m: heading, the age of a
reading in a turn, and the trajectory. Chosen: 61 widths err by 2.4 cm on average
(`benchmarks/mapping/doors.py`)."""
OTHERS = 0.05
"""Share of the hits near a jamb that belong to something else. Chosen."""
ON_END = np.array((0.0, 0.0, 0.05, 0.1))[:, None]
"""Shares of the hits on the end of the wall, each as likely as the next. Chosen: none, as of half
the walls, which are thin or seen from straight ahead; and those of walls of 10 and 20 cm."""
SYSTEMATIC_M = 0.03
"""Error of a width besides the noise, m: hits are not spread evenly, and the map moves between two
visits. Measured: with it 19 of 20 widths lie within two sigmas (`benchmarks/mapping/doors.py`)."""
BESIDE_M = 0.12
"""Hits this far off the surfaces beside the doorway are of the wall, m. Chosen: two sigmas."""
INTO_M, OUT_M = 0.5, 0.5
"""Hits count from this far into the doorway to this far along the wall, m. Chosen."""
WITHIN_M, STEP_M = 0.3, 0.005
"""The jamb is sought this far on either side of the wall's end, in these steps, m. Chosen."""
END_M = 0.15
"""An end of the doorway is the end of a wall within this distance, m. Chosen."""
IN_LINE = math.cos(math.radians(25))
"""Cosine of the largest angle between a wall and the doorway in it. Chosen: the doorway may go from
one surface to the other."""
MIN_HITS = 10
"""Least hits at a jamb. Chosen."""


class Jambs:
    """The ranges of a map, to measure its doorways with."""

    def __init__(self, plan: FloorPlan) -> None:
        self._walls: Sequence[WallSegment] = plan.walls
        ends_ne_m = [hit.position_ned_m[:2] for hit in plan.hits]
        self._ends: Array = np.array(ends_ne_m, dtype=float).reshape(-1, 2)
        self._eyes: Array = eyes_xy_m(plan)[:, ::-1]
        self._variance_m2: Array = np.array([hit.variance_m2 for hit in plan.hits])

    def measured(self, opening: "Opening") -> "Opening":
        """The opening with the width between its jambs; as it is if too few hits are there."""
        along = self._direction(opening)
        if along is None:
            return opening
        start, end = np.array(opening.start_ne_m), np.array(opening.end_ne_m)
        along = along if along @ (end - start) > 0 else -along
        across = np.array((-along[1], along[0]))
        middle = (start + end) / 2
        thick_m = abs(float((end - start) @ across)) / 2 + BESIDE_M
        is_wall = np.abs((self._ends - middle) @ across) < thick_m
        ends_m = (self._ends[is_wall] - middle) @ along
        sigma_m = self._sigma_m(is_wall, along)
        half_m = float((end - start) @ along) / 2
        sides = [_edge(sign * ends_m, sigma_m, half_m) for sign in (-1, 1)]
        if sides[0] is None or sides[1] is None:
            return opening
        (before_m, one_m), (behind_m, other_m) = sides[0], sides[1]
        first, last = middle - before_m * along, middle + behind_m * along
        return replace(
            opening,
            start_ne_m=(float(first[0]), float(first[1])),
            end_ne_m=(float(last[0]), float(last[1])),
            sigma_m=math.sqrt(one_m**2 + other_m**2 + SYSTEMATIC_M**2),
        )

    def _direction(self, opening: "Opening") -> Array | None:
        """Direction of the longest wall that ends at the opening and is in line with it."""
        ends = opening.start_ne_m, opening.end_ne_m
        beside = [
            wall
            for wall in self._walls
            if _is_in_line(wall, opening)
            and any(
                math.dist(end, its_end) < END_M
                for end in ends
                for its_end in (wall.start_ne_m, wall.end_ne_m)
            )
        ]
        if not beside:
            return None
        wall = max(beside, key=lambda wall: wall.length_m)
        direction: Array = np.subtract(wall.end_ne_m, wall.start_ne_m) / wall.length_m
        return direction

    def _sigma_m(self, which: Array, along: Array) -> Array:
        """(n,): sigma along the wall of the selected hits, m."""
        beams = self._ends[which] - self._eyes[which]
        length_m = np.maximum(np.hypot(*beams.T), 1e-3)
        share = np.clip((beams @ along / length_m) ** 2, 0.0, 1.0)
        by_bearing_m2 = (length_m * BEARING_RAD) ** 2 * (1 - share)
        sigma_m: Array = np.sqrt(self._variance_m2[which] * share + by_bearing_m2 + POSE_M**2)
        return sigma_m


def _is_in_line(wall: WallSegment, opening: "Opening") -> bool:
    along = np.subtract(wall.end_ne_m, wall.start_ne_m) / wall.length_m
    gap = np.subtract(opening.end_ne_m, opening.start_ne_m) / opening.width_m
    return abs(float(along @ gap)) > IN_LINE


def _edge(ends_m: Array, sigma_m: Array, near_m: float) -> Vector2 | None:
    """Place of a jamb and its sigma, m; the wall is where its hits (n,) are greater.

    `near_m`: the wall's first hit. None with too few hits.
    """
    is_near = (ends_m > near_m - INTO_M) & (ends_m < near_m + OUT_M)
    if np.count_nonzero(is_near) < MIN_HITS:
        return None
    hits_m, sigmas_m = ends_m[is_near, None], sigma_m[is_near, None]
    edges_m = np.arange(near_m - WITHIN_M, near_m + WITHIN_M, STEP_M)
    beyond = (hits_m - edges_m) / sigmas_m
    along = ndtr(beyond) / (near_m + OUT_M - edges_m)
    on_end = np.exp(-0.5 * beyond**2) / (math.sqrt(2 * math.pi) * sigmas_m)
    wall = (1 - ON_END[..., None]) * along + ON_END[..., None] * on_end
    likely = np.log(OTHERS / (INTO_M + OUT_M) + (1 - OTHERS) * wall).sum(axis=1)
    weights = np.exp(likely - likely.max()).sum(axis=0)
    mean_m = float(np.average(edges_m, weights=weights))
    return mean_m, math.sqrt(np.average((edges_m - mean_m) ** 2, weights=weights))
