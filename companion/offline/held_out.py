"""How well a map tells ranges that it was not made from.

That hits lie on walls says little: the walls were put through them. So the flight is cut into
stages (`growth.py`). One in FOLDS of them is left out, and trajectory and walls are solved for
again without its hits. Each of its ranges d is then compared with the first wall in the beam's way,
at d_wall:

    p(d) = w·N(d; d_wall, (s·σ)²) + (1 - w)·b(d)          gain = mean of ln(p(d) / b(d))

b is how often this beam told such a distance anywhere in the log, blurred by the noise σ; w and
s ≥ 1 are the likeliest. Ranges that have nothing to do with where they were measured have no gain,
however many of them lie on walls. As in cross-validation by predictive densities (Geisser and
Eddy 1979).
"""

from collections.abc import Iterator

import numpy as np

from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Array, Indices, Measured, Unknowns, project
from companion.offline.growth import Growth, stages

FOLDS = 5
"""Neighbours of a stage that is left out stay, so that odometry need only bridge one."""
MIN_COS = 0.15
"""Cosine of the incidence: a beam nearly along a wall tells nothing of where it meets it."""
REACH_M = 0.2
"""A wall is there so far beyond its outermost hits."""
ROUNDS = 50
"""Of the search for w and s; chosen."""
MIN_PREDICTED = 10
"""For fewer ranges no w and s are looked for: they would gain by being chosen."""
CELL_M = 0.005
BLUR_SIGMAS = 4.0


def gain(growth: Growth, m: Measured, units: RangeUnits) -> float:
    """Nats a range by which the map makes ranges likelier than their beam's own distribution.

    A range before which no wall stands gains nothing. `units` tell the noise.
    """
    off_m = m.distance_m - _predicted_m(growth, m)
    known = np.flatnonzero(np.isfinite(off_m))
    if len(known) < MIN_PREDICTED:
        return 0.0
    sigma_m = units.sigma_m(m.beam, m.distance_m)
    usual = _usual_per_m(m, sigma_m)[known] * sigma_m[known]
    return float(_gains(off_m[known] / sigma_m[known], usual).sum()) / len(m.beam)


def _predicted_m(growth: Growth, m: Measured) -> Array:
    """(n,): each range by the map made without the ranges around it; inf if there is no wall."""
    predicted_m = np.full(len(m.beam), np.inf)
    for hits in _folds(m):
        left_out = np.zeros(len(m.beam), dtype=bool)
        left_out[hits] = True
        predicted_m[hits] = _first_wall_m(growth.without(left_out), m, hits)
    return predicted_m


def _folds(m: Measured) -> Iterator[Indices]:
    """The hits of every FOLDS-th stage, from the first, the second, ... on."""
    fold = np.searchsorted(stages(m), m.frame, side="right") % FOLDS
    for number in range(FOLDS):
        hits: Indices = np.flatnonzero(fold == number)
        if len(hits):
            yield hits


def _first_wall_m(x: Unknowns, m: Measured, hits: Indices) -> Array:
    """(h,): from the sensor to the first wall in each beam's way; inf if there is none."""
    seen = project(x, m)
    origins, beams = seen.origins[hits], seen.beams[hits]
    first_m = np.full(len(hits), np.inf)
    for (_, offset_m), normal, tangent, (low_m, high_m) in zip(
        x.walls, x.normals, x.tangents, x.reach_m, strict=True
    ):
        cos = beams @ normal
        faces = cos > MIN_COS
        ahead_m = (offset_m - origins @ normal) / np.where(faces, cos, 1.0)
        along_m = (origins + ahead_m[:, None] * beams) @ tangent
        met = faces & (ahead_m > 0)
        met &= (along_m > low_m - REACH_M) & (along_m < high_m + REACH_M)
        first_m[met] = np.minimum(first_m[met], ahead_m[met])
    return (first_m - m.mount_m[hits]) / (1 - x.range_gain[m.beam[hits]])


def _usual_per_m(m: Measured, sigma_m: Array) -> Array:
    """(n,): how likely a beam is to tell each of its distances, by all others that it told, 1/m.

    The distances blurred by their noise; and one more anywhere up to the largest.
    """
    usual = np.empty(len(m.beam))
    for beam in np.unique(m.beam):
        mine = np.flatnonzero(m.beam == beam)
        distance_m, blur_m = m.distance_m[mine], float(np.median(sigma_m[mine]))
        largest_m = float(distance_m.max()) + blur_m
        margin = int(np.ceil(BLUR_SIGMAS * blur_m / CELL_M))
        cell = (distance_m / CELL_M).astype(np.int64)
        told = np.bincount(cell, minlength=int(largest_m / CELL_M) + 1)
        kernel = np.exp(-0.5 * (np.arange(-margin, margin + 1) * CELL_M / blur_m) ** 2)
        kernel /= kernel.sum() * CELL_M
        others = np.convolve(told, kernel)[margin:][cell] - kernel[margin]
        usual[mine] = (others + 1 / largest_m) / len(mine)
    return usual


def _gains(off: Array, usual: Array) -> Array:
    """(n,): ln(p / b) of ranges so many sigmas off, b being `usual` for each sigma of range.

    By expectation and maximization (Dempster, Laird and Rubin 1977).
    """
    share, spread = 0.5, 2.0
    for _ in range(ROUNDS):
        on_wall = share * _normal(off, spread)
        belongs = on_wall / (on_wall + (1 - share) * usual)
        share = float(belongs.mean())
        spread = max(1.0, float(np.sqrt((belongs * off**2).sum() / max(belongs.sum(), 1e-9))))
    likelier: Array = share * _normal(off, spread) / usual + 1 - share
    return np.log(likelier)


def _normal(off: Array, spread: float) -> Array:
    density: Array = np.exp(-0.5 * (off / spread) ** 2) / (spread * np.sqrt(2 * np.pi))
    return density
