"""Straight walls in a cloud of hits: a Hough transform, each peak refined by least squares.

Directions are of the normal from the drone to the wall, all round, so that the two sides of a
partition stay two walls. Hits that crowd at one place share one vote: a hovering drone would
otherwise make a wall of any direction out of the one spot it looks at.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import wrap_rad
from companion.estimation.association.gating import MIN_COS_INCIDENCE
from companion.estimation.association.pruning import Support
from companion.estimation.association.straightness import bend, longer_side

Array = NDArray[np.float64]

STEP_RAD = math.radians(3)
BIN_M = 0.12
CROWD_M = 0.15
SIGMAS = 2.5
REFINEMENTS = 4
MAX_PEAKS = 40
MAX_CUTS = 8
"""A row of hits that bends is cut where it does, so often."""
MAX_NORMAL_SIGMA_RAD = math.radians(4)
MAX_MISFIT = 2.0


@dataclass(frozen=True, slots=True)
class Cloud:
    """Hits (n, 2) with their sigmas (n,), and the bearings (n,) of their beams."""

    points: Array
    sigma_m: Array
    bearing_rad: Array


def detect_walls(cloud: Cloud, look: Support) -> tuple[Array, Array]:
    """Walls (w, 2), direction of the normal and offset, and their reach (w, 2); surest first.

    The reach is from where to where along (-sin, cos)(normal) there are hits.
    """
    votes = _votes(cloud)
    free = np.ones(len(cloud.points), dtype=bool)
    walls: list[Array] = []
    reach: list[tuple[float, float]] = []
    for _ in range(MAX_PEAKS):
        weight = np.where(free, votes.weight, 0.0)
        accumulator = np.bincount(
            votes.cell, (weight[:, None] * votes.faced).ravel(), minlength=votes.size
        )
        # A wall may lie astride two bins.
        accumulator = accumulator[:-1] + accumulator[1:]
        peak = int(accumulator.argmax())
        if accumulator[peak] < min(look.hits, 4):
            break
        found = _refine(cloud, free, votes.line(peak), look)
        if found is None:
            free &= ~votes.in_bins(peak)
            continue
        line, mine = found
        walls.append(line)
        along = _along(cloud.points[mine], line)
        reach.append((along.min(), along.max()))
        free &= ~mine
    return np.array(walls).reshape(-1, 2), np.array(reach).reshape(-1, 2)


@dataclass(frozen=True, slots=True)
class _Votes:
    cell: NDArray[np.int64]
    """(n · a,): the bin of each hit at each direction."""
    faced: NDArray[np.bool_]
    """(n, a)"""
    weight: Array
    low_m: float
    bins: int

    @property
    def size(self) -> int:
        return self.bins * int(self.faced.shape[1])

    def line(self, peak: int) -> Array:
        direction, offset = divmod(peak, self.bins)
        return np.array([direction * STEP_RAD, self.low_m + (offset + 1) * BIN_M])

    def in_bins(self, peak: int) -> NDArray[np.bool_]:
        direction = peak // self.bins
        cell = self.cell.reshape(self.faced.shape)[:, direction]
        inside: NDArray[np.bool_] = ((cell == peak) | (cell == peak + 1)) & self.faced[:, direction]
        return inside


def _votes(cloud: Cloud) -> _Votes:
    angle = np.arange(round(math.tau / STEP_RAD)) * STEP_RAD
    offset = cloud.points @ np.array([np.cos(angle), np.sin(angle)])
    low_m = float(offset.min(initial=0.0)) - BIN_M
    number = np.floor((offset - low_m) / BIN_M).astype(np.int64)
    bins = int(number.max(initial=0)) + 2
    _, crowd, size = np.unique(
        np.floor(cloud.points / CROWD_M), axis=0, return_inverse=True, return_counts=True
    )
    return _Votes(
        cell=(number + bins * np.arange(len(angle))).ravel(),
        faced=np.cos(cloud.bearing_rad[:, None] - angle) > MIN_COS_INCIDENCE,
        weight=1 / size[crowd.ravel()],
        low_m=low_m,
        bins=bins,
    )


def _refine(
    cloud: Cloud, free: NDArray[np.bool_], line: Array, look: Support
) -> tuple[Array, NDArray[np.bool_]] | None:
    """The line through the hits near a peak, and which they are; None if it is no wall."""
    slack_m = BIN_M
    mine = free
    sigma_rad = misfit = math.inf
    for _ in range(REFINEMENTS):
        _, across = _coordinates(cloud.points, line)
        faced = np.cos(cloud.bearing_rad - line[0]) > MIN_COS_INCIDENCE
        mine = free & faced & (np.abs(across) < slack_m + SIGMAS * cloud.sigma_m)
        mine = _longest_row(cloud.points, mine, line, look.gap_m)
        if mine.sum() < look.hits:
            return None
        line, sigma_rad, misfit = _fit(cloud, mine, line)
        slack_m *= 0.3
    for _ in range(MAX_CUTS):
        along, across = _coordinates(cloud.points[mine], line)
        bent = bend(along, across, cloud.sigma_m[mine])
        if bent.is_straight:
            break
        mine[np.flatnonzero(mine)[~longer_side(along, bent.at_m)]] = False
        if mine.sum() < look.hits:
            return None
        line, sigma_rad, misfit = _fit(cloud, mine, line)
    along = _along(cloud.points[mine], line)
    sure = sigma_rad < MAX_NORMAL_SIGMA_RAD and misfit < MAX_MISFIT
    return (line, mine) if sure and np.ptp(along) >= look.extent_m else None


def _longest_row(
    points: Array, mine: NDArray[np.bool_], line: Array, gap_m: float
) -> NDArray[np.bool_]:
    """Of the hits on a line those without a gap between them, where most of them are."""
    number = np.flatnonzero(mine)
    if not len(number):
        return mine
    along = _along(points[number], line)
    order = np.argsort(along, kind="stable")
    row = np.concatenate([[0], np.cumsum(np.diff(along[order]) > gap_m)])
    most = np.bincount(row).argmax()
    kept = np.zeros_like(mine)
    kept[number[order[row == most]]] = True
    return kept


def _fit(cloud: Cloud, mine: NDArray[np.bool_], line: Array) -> tuple[Array, float, float]:
    """Total least squares: the line, the sigma of its direction, and χ² by degrees of freedom."""
    weight = 1 / cloud.sigma_m[mine] ** 2
    points = cloud.points[mine]
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
    """Along the line and across it."""
    across: Array = points @ np.array([math.cos(line[0]), math.sin(line[0])]) - line[1]
    return _along(points, line), across


def _along(points: Array, line: Array) -> Array:
    along: Array = points @ np.array([-math.sin(line[0]), math.cos(line[0])])
    return along
