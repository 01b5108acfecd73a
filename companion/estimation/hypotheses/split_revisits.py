"""Tests whether a repeated visit to a wall belongs to another wall.

Adjacent rooms often have walls that are nearly in line. Taken for one wall, they shift the
trajectory by their offset, and then all residuals are small:

    true                ─────────                   taken for one     ─────────  ─────────
                                    ─────────
    the flight           ●──●──●──●──●──●──●                          ●──●──●╮
                                                                             ╰●──●──●──●

The other measurements still pull the trajectory back. A visit is a sequence of hits on a wall
without a long pause. For each visit a wall of its own, tied to the wall for now, is added to the
equations. With poses and all else free to follow, one step of that wall alone would lower χ² by

    gᵀ (C - Bᵀ A⁻¹ B)⁻¹ g        g: gradient by its own two unknowns, C: their information,
                                 A: information of all else, B: between them

as in a score test (Rao 1948). The equations are solved once for many visits.
"""

from collections.abc import Generator

import numpy as np

from companion.core.arrays import Array, Indices
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import WALL_SIZE, Measured

PAUSE_S = 5.0
"""A visit begins after a pause of this length without hits on the wall, s. Chosen."""
MIN_HITS = 8
"""Least hits of a visit. Chosen."""
MAX_VISITS, BATCH = 100, 25
"""Most visits tested, those with most hits; and visits per solution of the equations, which bounds
time and memory. Chosen."""
MIN_GAIN = 25.0
"""χ² that a visit's own wall has to save. Chosen: with correct associations the best visit saves
less than 15."""


def split_candidates(
    smoother: Smoother, estimate: Estimate, m: Measured, prior: MarginalPrior
) -> Generator[None, None, list[Indices]]:
    """Hits of the visits that belong to another wall, the largest χ² gain first.

    It yields after each piece of some milliseconds.
    """
    visits, gains = _visits(estimate, m, prior.walls), np.empty(0)
    for first in range(0, len(visits), BATCH):
        batch_gains = _gains(smoother, estimate, m, prior, visits[first : first + BATCH])
        gains = np.append(gains, batch_gains)
        yield
    return [visits[i] for i in np.argsort(-gains, kind="stable") if gains[i] >= MIN_GAIN]


def split(estimate: Estimate, visits: list[Indices]) -> Estimate:
    """Give each visit a wall of its own, at the place of its present wall."""
    x, wall_of = estimate.x.since(0), estimate.wall_of.copy()
    walls = wall_of[[hits[0] for hits in visits]]
    for number, hits in enumerate(visits):
        wall_of[hits] = len(x.walls) + number
    x.add_walls(x.walls[walls], x.reach_m[walls])
    return Estimate(x, wall_of, estimate.solution)


def _visits(estimate: Estimate, m: Measured, known: int) -> list[Indices]:
    """All visits worth testing. The first `known` walls have hits before the first of these."""
    time_s = m.time_s[m.frame]
    found: list[Indices] = []
    for wall in range(len(estimate.x.walls)):
        on_wall: Indices = np.flatnonzero(estimate.wall_of == wall)
        visits = np.split(on_wall, np.flatnonzero(np.diff(time_s[on_wall]) > PAUSE_S) + 1)
        if len(visits) > 1 or wall < known:
            found += [hits for hits in visits if len(hits) >= MIN_HITS]
    return sorted(found, key=len, reverse=True)[:MAX_VISITS]


def _gains(
    smoother: Smoother, estimate: Estimate, m: Measured, prior: MarginalPrior, visits: list[Indices]
) -> Array:
    """(v,): χ² that a wall of its own would save for each visit."""
    each = split(estimate, visits)
    information, gradient = smoother.system(each.x, m, each.wall_of, prior).of_shared()
    count = len(gradient) - WALL_SIZE * len(visits)
    tied = np.eye(len(gradient), count)
    walls = estimate.x.calibration.size
    for number, hits in enumerate(visits):
        wall, own = walls + WALL_SIZE * estimate.wall_of[hits[0]], WALL_SIZE * number
        for i in range(WALL_SIZE):
            tied[count + own + i, wall + i] = 1.0
    between = information @ tied
    response = between @ np.linalg.inv(tied.T @ between)
    reduced = (information - response @ between.T)[count:, count:]
    reduced_gradient = (gradient - response @ (tied.T @ gradient))[count:]
    at = WALL_SIZE * np.arange(len(visits))[:, None] + np.arange(WALL_SIZE)
    blocks, gradients = reduced[at[:, :, None], at[:, None, :]], reduced_gradient[at]
    gains: Array = (gradients * np.linalg.solve(blocks, gradients[..., None])[..., 0]).sum(axis=1)
    return gains
