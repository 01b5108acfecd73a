"""Drops or joins walls where the map is more likely with fewer.

The association decides about a wall by the hits beside it. Here the χ² of the whole map decides:

    before  ━━━━━━━━━━━  ━━━━━       after  ━━━━━━━━━━━━━━━━━━    two pieces of one surface: joined
    before  ━━━━╺━╸━━━━━             after  ━━━━━━━━━━━           a row of outliers: dropped

Solutions are compared after that: a wall that is not needed costs as much as a wrong association.
"""

from collections.abc import Generator, Iterator

import numpy as np

from companion.core.arrays import Indices
from companion.core.frames import wrap_rad
from companion.estimation.association.merging import MAX_MERGE_GAP_M, SAME_DIRECTION_RAD
from companion.estimation.hypotheses.chi_square import (
    WALL_COST,
    cost,
    hit_costs,
    passage_costs,
)
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import Measured, Unknowns, project


def with_fewer_walls(
    smoother: Smoother, estimate: Estimate, m: Measured, prior: MarginalPrior
) -> Generator[None, None, Estimate]:
    """The solution without the walls that do not save their cost; those with few hits first.

    The hits of such a wall go to no wall, or to a wall in line with it. The walls of the prior
    stay. It yields after each alternative.
    """
    walls = len(estimate.x.walls)
    hits = np.bincount(estimate.wall_of[estimate.wall_of != NO_WALL], minlength=walls)
    new = np.arange(prior.walls, walls)
    now, left, least = estimate, np.arange(walls), cost(smoother, estimate, m, prior)
    through = passage_costs(smoother, now.x, m, now.wall_of)
    for wall in new[np.argsort(hits[new], kind="stable")]:
        before, at = now, int(np.searchsorted(left, wall))
        for other in (NO_WALL, *_in_line(before.x, at)):
            fewer = _without(before, at, other, m)
            yield
            if _hits_cost_more(smoother, before, fewer, m, at) >= WALL_COST + through[at]:
                continue
            if (lower := cost(smoother, fewer, m, prior)) < least:
                now, least = fewer, lower
        if now is not before:
            left = left[left != wall]
            through = passage_costs(smoother, now.x, m, now.wall_of)
    if now is estimate:
        return estimate
    solution = smoother.step(now.x, m, now.wall_of, prior)
    return Estimate(now.x, now.wall_of, solution)


def _hits_cost_more(
    smoother: Smoother, before: Estimate, after: Estimate, m: Measured, wall: int
) -> float:
    """How much more the hits of a wall cost without it.

    It is the least that the map costs more, apart from the wall itself and beams through it.
    """
    own = before.wall_of == wall
    part = m.with_hits(own)
    more = [
        sum(float(costs.sum()) for costs in hit_costs(smoother, each.x, part, each.wall_of[own]))
        for each in (before, after)
    ]
    return more[1] - more[0]


def _in_line(x: Unknowns, wall: int) -> Iterator[int]:
    """The other walls of nearly the same direction that overlap a wall, or nearly do."""
    low_m, high_m = x.reach_m[wall]
    for other, (line, (begin_m, end_m)) in enumerate(zip(x.walls, x.reach_m, strict=True)):
        turned_rad = wrap_rad(float(line[0] - x.walls[wall, 0]))
        gap_m = max(low_m - end_m, begin_m - high_m)
        if other != wall and abs(turned_rad) < SAME_DIRECTION_RAD and gap_m < MAX_MERGE_GAP_M:
            yield other


def _without(estimate: Estimate, wall: int, other: int, m: Measured) -> Estimate:
    """A wall is removed; its hits go to another wall, or to none. The lines stay as they are."""
    x = estimate.x.since(0)
    moved: Indices = np.where(estimate.wall_of == wall, other, estimate.wall_of)
    wall_of = x.keep_walls(np.delete(np.arange(len(x.walls)), wall), moved)
    if other != NO_WALL:
        own = m.with_hits(estimate.wall_of == wall)
        along_m = project(x, own).points @ estimate.x.tangents[other]
        low_m, high_m = estimate.x.reach_m[other]
        reach_m = along_m.min(initial=low_m), along_m.max(initial=high_m)
        x.reach_m[other - (other > wall)] = reach_m
    return Estimate(x, wall_of, estimate.solution)
