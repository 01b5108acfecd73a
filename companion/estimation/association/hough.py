"""Detects straight walls in hits: a Hough transform with a least-squares fit of each peak.

Directions are those of the normal from the drone to the wall, over 360°, so the two sides of a
partition stay two walls. Hits that crowd in one cell share one vote. Otherwise a hovering drone
would make a wall of any direction from one spot.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import wrap_rad
from companion.estimation.association.gating import MIN_COS_INCIDENCE
from companion.estimation.association.pruning import Support
from companion.estimation.association.straightness import bend, longer_side

STEP_RAD = math.radians(3)
"""Directions are binned by this, rad. Chosen."""
DIRECTIONS = round(math.tau / STEP_RAD)
"""Number of those bins."""
BIN_M = 0.12
"""Offsets are binned by this, m. Chosen."""
CROWD_M = 0.15
"""Hits in a cell of this size share one vote, m. Chosen."""
SIGMAS = 2.5
"""Hits within this many sigmas of a line, plus its slack, are on it. Chosen."""
REFINEMENTS = 4
"""Least-squares fits of each peak. Chosen."""
MAX_PEAKS = 40
"""Most peaks evaluated in one cloud. Chosen."""
MAX_CUTS = 8
"""Most cuts of a row of hits at its bends. Chosen."""
MAX_NORMAL_SIGMA_RAD = math.radians(4)
"""Largest sigma of a detected wall's direction, rad. Chosen."""
MAX_MISFIT = 2.0
"""Largest χ² per degree of freedom of a detected wall. Chosen."""


@dataclass(frozen=True, slots=True)
class Cloud:
    """Hits (n, 2) with their sigmas (n,) and the bearings (n,) of their beams."""

    points: Array
    sigma_m: Array
    bearing_rad: Array


def detect_walls(cloud: Cloud, support: Support) -> tuple[Array, Array]:
    """Walls (w, 2), direction of the normal and offset, and their reach (w, 2); best first.

    The reach is the interval of hits along (-sin, cos)(normal).
    """
    votes = _votes(cloud)
    free = np.ones(len(cloud.points), dtype=bool)
    walls: list[Array] = []
    reach: list[tuple[float, float]] = []
    for _ in range(MAX_PEAKS):
        weight = np.where(free, votes.weight, 0.0)
        accumulator = np.bincount(votes.cell, weight[votes.hit], minlength=votes.size)
        # A wall may span two bins.
        accumulator = accumulator[:-1] + accumulator[1:]
        peak = int(accumulator.argmax())
        if accumulator[peak] < min(support.hits, 4):
            break
        found = _refine(cloud, free, votes.line(peak), support)
        if found is None:
            free &= ~votes.in_bins(peak)
            continue
        line, on_line = found
        walls.append(line)
        along = _along(cloud.points[on_line], line)
        reach.append((along.min(), along.max()))
        free &= ~on_line
    return np.array(walls).reshape(-1, 2), np.array(reach).reshape(-1, 2)


@dataclass(frozen=True, slots=True)
class _Votes:
    """Each hit votes for all lines through it whose front its beam can reach."""

    hit: Indices
    """(v,)."""
    cell: Indices
    """(v,): bin of direction and offset."""
    weight: Array
    """(n,): weight of each hit's votes."""
    low_m: float
    bins: int
    """Number of offsets."""

    @property
    def size(self) -> int:
        return self.bins * DIRECTIONS

    def line(self, peak: int) -> Array:
        direction, offset = divmod(peak, self.bins)
        return np.array([direction * STEP_RAD, self.low_m + (offset + 1) * BIN_M])

    def in_bins(self, peak: int) -> Mask:
        """(n,): True for the hits that vote for the peak's two bins."""
        inside = np.zeros(len(self.weight), dtype=bool)
        inside[self.hit[(self.cell == peak) | (self.cell == peak + 1)]] = True
        return inside


def _votes(cloud: Cloud) -> _Votes:
    angle = np.arange(DIRECTIONS) * STEP_RAD
    offset = cloud.points @ np.array([np.cos(angle), np.sin(angle)])
    low_m = float(offset.min(initial=0.0)) - BIN_M
    number = np.floor((offset - low_m) / BIN_M).astype(np.int64)
    bins = int(number.max(initial=0)) + 2
    _, crowd, size = np.unique(
        np.floor(cloud.points / CROWD_M), axis=0, return_inverse=True, return_counts=True
    )
    hit, direction = np.nonzero(np.cos(cloud.bearing_rad[:, None] - angle) > MIN_COS_INCIDENCE)
    return _Votes(
        hit,
        cell=number[hit, direction] + bins * direction,
        weight=1 / size[crowd.ravel()],
        low_m=low_m,
        bins=bins,
    )


def _refine(cloud: Cloud, free: Mask, line: Array, support: Support) -> tuple[Array, Mask] | None:
    """Fit a line to the hits near a peak; returns it with the mask of its hits.

    None if it is no wall.
    """
    slack_m = BIN_M
    on_line = free
    sigma_rad = misfit = math.inf
    for _ in range(REFINEMENTS):
        _, across = _coordinates(cloud.points, line)
        is_facing = np.cos(cloud.bearing_rad - line[0]) > MIN_COS_INCIDENCE
        on_line = free & is_facing & (np.abs(across) < slack_m + SIGMAS * cloud.sigma_m)
        on_line = _longest_row(cloud.points, on_line, line, support.gap_m)
        if on_line.sum() < support.hits:
            return None
        line, sigma_rad, misfit = _fit(cloud, on_line, line)
        slack_m *= 0.3
    for _ in range(MAX_CUTS):
        along, across = _coordinates(cloud.points[on_line], line)
        bent = bend(along, across, cloud.sigma_m[on_line])
        if bent.is_straight:
            break
        on_line[np.flatnonzero(on_line)[~longer_side(along, bent.at_m)]] = False
        if on_line.sum() < support.hits:
            return None
        line, sigma_rad, misfit = _fit(cloud, on_line, line)
    along = _along(cloud.points[on_line], line)
    is_certain = sigma_rad < MAX_NORMAL_SIGMA_RAD and misfit < MAX_MISFIT
    return (line, on_line) if is_certain and np.ptp(along) >= support.extent_m else None


def _longest_row(points: Array, on_line: Mask, line: Array, gap_m: float) -> Mask:
    """The hits on a line without a gap between them, in the row with the most hits."""
    number = np.flatnonzero(on_line)
    if not len(number):
        return on_line
    along = _along(points[number], line)
    order = np.argsort(along, kind="stable")
    row = np.concatenate([[0], np.cumsum(np.diff(along[order]) > gap_m)])
    most = np.bincount(row).argmax()
    kept = np.zeros_like(on_line)
    kept[number[order[row == most]]] = True
    return kept


def _fit(cloud: Cloud, on_line: Mask, line: Array) -> tuple[Array, float, float]:
    """Total least squares: the line, sigma of its direction, and χ² per degree of freedom."""
    weight = 1 / cloud.sigma_m[on_line] ** 2
    points = cloud.points[on_line]
    centre = weight @ points / weight.sum()
    arm = points - centre
    spread, axes = np.linalg.eigh((weight[:, None] * arm).T @ arm)
    normal = axes[:, 0]
    if normal @ (math.cos(line[0]), math.sin(line[0])) < 0:
        normal = -normal
    fitted = np.array([wrap_rad(math.atan2(normal[1], normal[0])), centre @ normal])
    sigma_rad = 1 / math.sqrt(max(spread[1], 1e-9))
    return fitted, sigma_rad, float(spread[0]) / max(len(points) - 2, 1)


def _coordinates(points: Array, line: Array) -> tuple[Array, Array]:
    """Coordinates along the line and across it."""
    across: Array = points @ np.array([math.cos(line[0]), math.sin(line[0])]) - line[1]
    return _along(points, line), across


def _along(points: Array, line: Array) -> Array:
    along: Array = points @ np.array([-math.sin(line[0]), math.cos(line[0])])
    return along
