"""Where odometry speaks against what the walls made of the flight.

Hits on a wrong wall pull the trajectory aside, and then fit well. But from one moment to another
the drone has not moved like that: over some seconds the steps, beside what odometry measured, add
up to far more than its noise does.
"""

import itertools
from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from companion.estimation.candidates import UNEXPLAINED, Gate
from companion.estimation.estimate import Estimate, Past
from companion.estimation.factors import hit_residuals
from companion.estimation.flight_record import NO_WALL
from companion.estimation.line_slam import OdometryModel
from companion.estimation.smoother import Smoother
from companion.estimation.unknowns import Array, Measured, Unknowns, to_ned

SPANS_S = (2.0, 4.0, 8.0, 16.0)
"""Of long ones only those in which no shorter one shows where it was."""
SIGMAS = 3.0
TOGETHER_S = 30.0
"""What lies between two such moments no farther apart was pulled aside by the first and let go at
the second."""
MOST_RECONSIDERED = 3
BRIDGING_STEPS = 2
WALL_COST = 20.0
"""χ² that a wall must save to be part of the likelier of two maps: two unknowns, ln n each."""


def reconsidering(
    smoother: Smoother, estimate: Estimate, m: Measured, past: Past, gates: Sequence[Gate]
) -> Generator[None, None, Estimate]:
    """A likelier flight, where odometry contradicts this one; in pieces of some milliseconds.

    What the beams met there is forgotten, the trajectory bridged by odometry, and the hits given
    to walls from there. Whichever explains all measurements better is kept: it may be odometry
    that was wrong.
    """
    first = replace(gates[1], looks=gates[0].looks)
    for _ in range(MOST_RECONSIDERED):
        doubted = contradicted(estimate.x, m, smoother.models.odometry)
        if not doubted.any():
            break
        x = estimate.x.since(0)
        wall_of = np.where(doubted[m.frame], NO_WALL, estimate.wall_of)
        for _ in range(BRIDGING_STEPS):
            smoother.step(x, m, wall_of, past)
            yield
        other = yield from smoother.smoothing(x, m, past, (first, *gates[2:]))
        if cost(smoother, other, m, past) >= cost(smoother, estimate, m, past):
            break
        estimate = other
    return estimate


def cost(smoother: Smoother, estimate: Estimate, m: Measured, past: Past) -> float:
    """χ² of all that was measured, robust against hits that fit nothing, and of its walls."""
    x, wall_of = estimate.x, estimate.wall_of
    off = hit_residuals(x, m, wall_of, smoother.models.ranges)
    hits = np.minimum(off**2, UNEXPLAINED).sum() + UNEXPLAINED * np.sum(wall_of == NO_WALL)
    believed = past.belief.cost(past.beside(x))
    return smoother.motion(x, m).squares + float(hits) + believed + WALL_COST * len(x.walls)


def contradicted(x: Unknowns, m: Measured, model: OdometryModel) -> NDArray[np.bool_]:
    """(k,): the keyframes about which odometry says something else."""
    time_s = np.concatenate([[0.0], np.cumsum(m.dt_s)])
    strain_m, variance_m2 = _sums(x, m, model)
    against = np.zeros(len(time_s), dtype=bool)
    for span_s in SPANS_S:
        begin = np.arange(np.searchsorted(time_s, time_s[-1] - span_s, side="right"))
        end = np.searchsorted(time_s, time_s[begin] + span_s)
        strained_m = np.abs(strain_m[end] - strain_m[begin]).max(axis=1, initial=0.0)
        sigma_m = np.sqrt(variance_m2[end] - variance_m2[begin])
        known = against.copy()
        for wrong in np.flatnonzero(strained_m > SIGMAS * sigma_m):
            span = slice(begin[wrong], end[wrong] + 1)
            against[span] |= not known[span].any()
    at = np.flatnonzero(against)
    for before, after in itertools.pairwise(at):
        against[before:after] |= time_s[after] - time_s[before] < TOGETHER_S
    return against


def _sums(x: Unknowns, m: Measured, model: OdometryModel) -> tuple[Array, Array]:
    """Added up from the first keyframe to each: (k, 2) metres beside odometry, (k,) variances."""
    by_odometry = to_ned((1 + x.odometry_scale) * m.moved_frd_m, x.poses[:-1, 2])
    strain_m = np.zeros((len(x.poses), 2))
    strain_m[1:] = np.cumsum(np.diff(x.poses[:, :2], axis=0) - by_odometry, axis=0)
    variance_m2 = np.zeros(len(x.poses))
    variance_m2[1:] = np.cumsum(model.step_sigma_m(m.dt_s) ** 2)
    return strain_m, variance_m2
