"""Finds stretches of a flight that would fit the rest of it better after a shift.

With wrong associations a stretch can be offset from the map and create walls of its own, with small
residuals. No other part of the flight has hits on these walls:

    hits before and after     ───────────        ───────────
    hits of the stretch           ───────────        ───────────      shifted, they coincide

The hits of a stretch are matched with the walls of the rest of the flight, as in correlative scan
matching (Olson 2009), with shifts of up to 0.8 m. The best shift puts the most hits on walls.
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices
from companion.estimation.association.gating import MIN_COS_INCIDENCE
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Measured, Rays, Unknowns, project, reach_m

SPANS_S = (60.0, 120.0, 240.0, 480.0)
"""Lengths of the stretches, s; stretches overlap by half. Chosen."""
MIN_LENGTH_S = 15.0
"""Least length of the last stretch, s. Chosen."""
RAMP_S = 15.0
"""The shift fades in and out over this time before and after the stretch, s. Chosen: at most 5 cm/s
on each axis."""
MAX_M, STEP_M = 0.8, 0.1
"""Largest shift in each axis and its increment, m. Chosen."""
MAX_SIGMA_M = 0.06
"""Hits with a larger sigma are not used, m. Chosen."""
ON_WALL_M, BEYOND_END_M = 0.05, 0.1
"""A hit is on a wall within this distance plus one sigma, and this far beyond its ends, m.
Chosen."""
MIN_HITS, MAX_HITS = 100, 400
"""Hits used of one stretch. Chosen: a larger sample gives no better estimate."""
MIN_HITS_ELSEWHERE = 8
"""Least hits from outside the stretch on a wall used for matching. Chosen."""
MIN_GAIN = 0.05
"""Least share of a stretch's hits that the shift must add to those on walls. Chosen."""


@dataclass(frozen=True, slots=True)
class Shift:
    """A stretch and its best shift."""

    begin_s: float
    end_s: float
    by_ne_m: Array
    """(2,): shift north and east, m."""
    gain: float
    """Share of the hits on walls after the shift, less the share before."""


def shifts(
    estimate: Estimate, m: Measured, units: RangeUnits
) -> Generator[None, None, list[Shift]]:
    """Find the shifts with the largest gain first, in pieces of some milliseconds."""
    x, rays = estimate.x, project(estimate.x, m)
    time_s, sigma_m = m.time_s[m.frame], units.sigma_m(m.beam, m.distance_m)
    found = []
    for begin_s, end_s in _stretches(float(time_s.max(initial=0.0))):
        inside = (time_s >= begin_s) & (time_s < end_s)
        accurate: Indices = np.flatnonzero(inside & (sigma_m < MAX_SIGMA_M))
        if len(accurate) < MIN_HITS:
            continue
        sample = accurate[
            np.linspace(0, len(accurate) - 1, min(len(accurate), MAX_HITS)).astype(int)
        ]
        elsewhere = np.where(inside, NO_WALL, estimate.wall_of)
        shares = _shares_on_walls(x, rays, sigma_m, sample, elsewhere)
        best = int(shares.argmax())
        gain = float(shares[best] - shares[len(shares) // 2])
        found.append(Shift(begin_s, end_s, _BY_NE_M[best], gain))
        yield
    worth = (shift for shift in found if shift.gain > MIN_GAIN)
    return sorted(worth, key=lambda shift: -shift.gain)


def shifted(x: Unknowns, m: Measured, shift: Shift) -> Unknowns:
    """Apply a shift, faded in and out before and after the stretch."""
    moved = x.since(0)
    ends_s = shift.begin_s - RAMP_S, shift.begin_s, shift.end_s, shift.end_s + RAMP_S
    share = np.interp(m.time_s, ends_s, (0.0, 1.0, 1.0, 0.0))
    moved.poses[:, :2] += share[:, None] * shift.by_ne_m
    return moved


def _places_ne_m() -> Array:
    """(s, 2): all tested shifts; the zero shift is in the middle."""
    steps_m = STEP_M * np.arange(-round(MAX_M / STEP_M), round(MAX_M / STEP_M) + 1)
    return np.stack(np.meshgrid(steps_m, steps_m, indexing="ij"), axis=-1).reshape(-1, 2)


_BY_NE_M = _places_ne_m()


def _stretches(length_s: float) -> Iterator[tuple[float, float]]:
    for span_s in SPANS_S:
        for begin_s in np.arange(0.0, length_s - MIN_LENGTH_S, span_s / 2).tolist():
            yield begin_s, begin_s + span_s


def _shares_on_walls(
    x: Unknowns, rays: Rays, sigma_m: Array, sample: Indices, wall_of: Indices
) -> Array:
    """(s,): share of the sampled hits that are on walls, for each shift."""
    hits_of = np.bincount(wall_of[wall_of != NO_WALL], minlength=len(x.walls))
    walls: Indices = np.flatnonzero(hits_of >= MIN_HITS_ELSEWHERE)
    low_m, high_m = reach_m(x, rays.points, wall_of)[walls].T
    normals, tangents = x.normals[walls], x.tangents[walls]
    off_m = rays.points[sample] @ normals.T - x.walls[walls, 1]
    is_facing = rays.beams[sample] @ normals.T > MIN_COS_INCIDENCE
    hit, wall = np.nonzero(is_facing & (np.abs(off_m) < 2 * MAX_M))
    if not len(hit):
        return np.zeros(len(_BY_NE_M))
    along_m = (rays.points[sample][hit] * tangents[wall]).sum(axis=1)[:, None]
    along_m = along_m + tangents[wall] @ _BY_NE_M.T
    across_m = off_m[hit, wall][:, None] + normals[wall] @ _BY_NE_M.T
    is_on = np.abs(across_m) < ON_WALL_M + sigma_m[sample][hit][:, None]
    is_on &= along_m > low_m[wall][:, None] - BEYOND_END_M
    is_on &= along_m < high_m[wall][:, None] + BEYOND_END_M
    firsts = np.flatnonzero(np.diff(hit, prepend=-1))
    shares: Array = np.logical_or.reduceat(is_on, firsts, axis=0).sum(axis=0) / len(sample)
    return shares
