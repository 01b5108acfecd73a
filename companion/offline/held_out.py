"""Measures how well a map predicts ranges that it was not made from.

Hits on walls prove little, because the walls were fitted to them. So the flight is cut into stages
(`growth.py`). One stage in FOLDS is held out, and trajectory and walls are solved again without its
hits. Each of its ranges d is compared with the first wall along the beam, at d_wall:

    p(d) = w·N(d; d_wall, (s·σ)²) + (1 - w)·b(d)          gain = mean of ln(p(d) / b(d))

b is the distribution of this beam's distances over the log, blurred by the noise σ. w and s ≥ 1 are
the most likely values. Ranges that are unrelated to the place of measurement have no gain, even if
many are on walls. The method is cross-validation by predictive densities (Geisser and Eddy 1979).
"""

from collections.abc import Iterator

import numpy as np
from scipy.special import stdtr

from companion.core.arrays import Array, Indices
from companion.estimation.hypotheses.chi_square import BEYOND_END_M
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Measured, Unknowns, project
from companion.offline.growth import IncrementalMap, stages

FOLDS = 5
"""One stage in this many is held out. Chosen: its neighbours stay, so odometry bridges one stage
only."""
MIN_COS = 0.15
"""Least cosine of the incidence. Chosen: a beam nearly along a wall has no definite range."""
ROUNDS = 50
"""Iterations for w and s. Chosen."""
MIN_PREDICTED = 10
"""Least predicted ranges. Chosen: with fewer, the choice of w and s alone would yield a gain."""
CELL_M = 0.005
"""Bins of the distance distribution, m. Chosen."""
BLUR_SIGMAS = 4.0
"""Width of the blur kernel to either side, in sigmas. Chosen."""


def gains(solution: IncrementalMap, m: Measured, units: RangeUnits) -> Array:
    """(n,): log-likelihood gain of each range, nats, by the map over the beam's own distribution.

    A range without a wall along its beam has no gain. `units` contain the noise.
    """
    gained = np.zeros(len(m.beam))
    residual_m = m.distance_m - _predicted_m(solution, m)
    known = np.flatnonzero(np.isfinite(residual_m))
    if len(known) >= MIN_PREDICTED:
        sigma_m = units.sigma_m(m.beam, m.distance_m)
        usual = _usual_per_m(m, sigma_m)[known] * sigma_m[known]
        gained[known] = _gains(residual_m[known] / sigma_m[known], usual)
    return gained


def mean_gain(gained: Array) -> float:
    """Mean of the gains (n,); 0 without ranges."""
    return float(gained.sum()) / max(len(gained), 1)


def predicts_better(found: Array, other: Array, m: Measured) -> float:
    """Probability that one map predicts ranges better than another, from the gains (n,) of both.

    By Student's t of the differences. Ranges of one stage have common errors, so each stage counts
    as one observation (Liang and Zeger 1986).
    """
    stage = np.searchsorted(stages(m), m.frame, side="right")
    by_stage = np.bincount(stage, found - other)[np.unique(stage)]
    if len(by_stage) < 2 or not by_stage.any():
        return 0.5
    t = by_stage.sum() / np.sqrt((by_stage**2).sum())
    return float(stdtr(len(by_stage) - 1, t))


def _predicted_m(solution: IncrementalMap, m: Measured) -> Array:
    """(n,): prediction of each range by the map without ranges around it; inf without a wall."""
    predicted_m = np.full(len(m.beam), np.inf)
    for hits in _folds(m):
        held_out = np.zeros(len(m.beam), dtype=bool)
        held_out[hits] = True
        predicted_m[hits] = _first_wall_m(solution.without(held_out), m, hits)
    return predicted_m


def _folds(m: Measured) -> Iterator[Indices]:
    """Hits of every FOLDS-th stage, starting with the first, the second, ... stage."""
    fold = np.searchsorted(stages(m), m.frame, side="right") % FOLDS
    for number in range(FOLDS):
        hits: Indices = np.flatnonzero(fold == number)
        if len(hits):
            yield hits


def _first_wall_m(x: Unknowns, m: Measured, hits: Indices) -> Array:
    """(h,): distance from the sensor to the first wall along each beam; inf without a wall."""
    rays = project(x, m)
    origins, beams = rays.origins[hits], rays.beams[hits]
    first_m = np.full(len(hits), np.inf)
    for (_, offset_m), normal, tangent, (low_m, high_m) in zip(
        x.walls, x.normals, x.tangents, x.reach_m, strict=True
    ):
        cos = beams @ normal
        is_facing = cos > MIN_COS
        ahead_m = (offset_m - origins @ normal) / np.where(is_facing, cos, 1.0)
        along_m = (origins + ahead_m[:, None] * beams) @ tangent
        met = is_facing & (ahead_m > 0)
        met &= (along_m > low_m - BEYOND_END_M) & (along_m < high_m + BEYOND_END_M)
        first_m[met] = np.minimum(first_m[met], ahead_m[met])
    return (first_m - m.mount_m[hits]) / (1 - x.range_gain[m.hit_flight[hits], m.beam[hits]])


def _usual_per_m(m: Measured, sigma_m: Array) -> Array:
    """(n,): density of each distance in the beam's own distribution without this reading, 1/m.

    The distribution is blurred by the noise and contains one more reading, uniform up to the
    largest.
    """
    usual = np.empty(len(m.beam))
    for beam in np.unique(m.beam):
        of_beam = np.flatnonzero(m.beam == beam)
        distance_m, blur_m = m.distance_m[of_beam], float(np.median(sigma_m[of_beam]))
        largest_m = float(distance_m.max()) + blur_m
        margin = int(np.ceil(BLUR_SIGMAS * blur_m / CELL_M))
        cell = (distance_m / CELL_M).astype(np.int64)
        counts = np.bincount(cell, minlength=int(largest_m / CELL_M) + 1)
        kernel = np.exp(-0.5 * (np.arange(-margin, margin + 1) * CELL_M / blur_m) ** 2)
        kernel /= kernel.sum() * CELL_M
        others = np.convolve(counts, kernel)[margin:][cell] - kernel[margin]
        usual[of_beam] = (others + 1 / largest_m) / len(of_beam)
    return usual


def _gains(residual: Array, usual: Array) -> Array:
    """(n,): ln(p / b) for residuals in sigmas; `usual` is b per sigma of range.

    By expectation and maximization (Dempster, Laird and Rubin 1977).
    """
    share, spread = 0.5, 2.0
    for _ in range(ROUNDS):
        on_wall = share * _normal(residual, spread)
        weight = on_wall / (on_wall + (1 - share) * usual)
        share = float(weight.mean())
        spread = max(1.0, float(np.sqrt((weight * residual**2).sum() / max(weight.sum(), 1e-9))))
    ratio: Array = share * _normal(residual, spread) / usual + 1 - share
    return np.log(ratio)


def _normal(residual: Array, spread: float) -> Array:
    density: Array = np.exp(-0.5 * (residual / spread) ** 2) / (spread * np.sqrt(2 * np.pi))
    return density
