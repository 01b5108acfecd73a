"""Whether what was met again is the wall that it was taken for.

Rooms side by side often have walls that are nearly in line. Taken for one, they pull the flight
aside by what lies between them, and then everything fits well:

    as they are         ─────────                   taken for one     ─────────  ─────────
                                    ─────────
    the flight           ●──●──●──●──●──●──●                          ●──●──●╮
                                                                             ╰●──●──●──●

But what holds the flight where it was goes on pulling. For each visit, the hits on a wall without a
long pause between them, a wall of its own is added to the equations, tied to the wall for now; with
poses and all else free to follow, one step of that wall alone would lower χ² by

    gᵀ (C - Bᵀ A⁻¹ B)⁻¹ g        g: gradient by its own two unknowns, C: their information,
                                 A: that of all else, B: between them

as in a score test (Rao 1948): the equations are solved once for many visits.
"""

from collections.abc import Generator

import numpy as np

from companion.estimation.smoothing import factors
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import WALL_SIZE, Array, Indices, Measured

PAUSE_S = 5.0
"""A wall that has not been met for so long is visited again."""
MIN_HITS = 8
MAX_VISITS, AT_ONCE = 100, 25
"""Those with most hits; and so many for one solution of the equations: time and memory."""
MIN_GAIN = 25.0
"""χ² that a visit's own wall has to save; where all walls are right, the best of them save 15."""


def doubting(
    smoother: Smoother, estimate: Estimate, m: Measured, past: MarginalPrior
) -> Generator[None, None, list[Indices]]:
    """The hits of visits to walls that must have been others, those that save most first.

    In pieces of some milliseconds: it yields after each.
    """
    visits, gains = _visits(estimate, m, past.walls), np.empty(0)
    for first in range(0, len(visits), AT_ONCE):
        some = _gains(smoother, estimate, m, past, visits[first : first + AT_ONCE])
        gains = np.append(gains, some)
        yield
    return [visits[i] for i in np.argsort(-gains, kind="stable") if gains[i] >= MIN_GAIN]


def apart(estimate: Estimate, visits: list[Indices]) -> Estimate:
    """With a wall for each of the visits, where its wall is."""
    x, wall_of = estimate.x.since(0), estimate.wall_of.copy()
    walls = wall_of[[hits[0] for hits in visits]]
    for number, hits in enumerate(visits):
        wall_of[hits] = len(x.walls) + number
    x.add_walls(x.walls[walls], x.reach_m[walls])
    return Estimate(x, wall_of, estimate.solution)


def _visits(estimate: Estimate, m: Measured, known: int) -> list[Indices]:
    """The first `known` walls had been met before the first of these hits."""
    time_s = m.time_s[m.frame]
    found: list[Indices] = []
    for wall in range(len(estimate.x.walls)):
        mine: Indices = np.flatnonzero(estimate.wall_of == wall)
        visits = np.split(mine, np.flatnonzero(np.diff(time_s[mine]) > PAUSE_S) + 1)
        if len(visits) > 1 or wall < known:
            found += [hits for hits in visits if len(hits) >= MIN_HITS]
    return sorted(found, key=len, reverse=True)[:MAX_VISITS]


def _gains(
    smoother: Smoother, estimate: Estimate, m: Measured, past: MarginalPrior, visits: list[Indices]
) -> Array:
    """(v,): the χ² that a wall of its own would save each of them."""
    each = apart(estimate, visits)
    information, gradient = smoother.system(each.x, m, each.wall_of, past).of_shared()
    count = len(gradient) - WALL_SIZE * len(visits)
    tied = np.eye(len(gradient), count)
    for number, hits in enumerate(visits):
        wall, own = factors.WALLS + WALL_SIZE * estimate.wall_of[hits[0]], WALL_SIZE * number
        for i in range(WALL_SIZE):
            tied[count + own + i, wall + i] = 1.0
    between = information @ tied
    followed = between @ np.linalg.inv(tied.T @ between)
    left = (information - followed @ between.T)[count:, count:]
    pull = (gradient - followed @ (tied.T @ gradient))[count:]
    at = WALL_SIZE * np.arange(len(visits))[:, None] + np.arange(WALL_SIZE)
    blocks, pulls = left[at[:, :, None], at[:, None, :]], pull[at]
    gains: Array = (pulls * np.linalg.solve(blocks, pulls[..., None])[..., 0]).sum(axis=1)
    return gains
