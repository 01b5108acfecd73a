"""Stretches of a flight that would fit the rest of it better beside where they are.

Where hits were given to a wrong wall, the flight goes on beside the map, and draws walls of its own
there, which fit well. But nothing else has met those:

    met before and after      ───────────        ───────────
    by the stretch alone          ───────────        ───────────      shifted, it met these, too

So what a stretch met is laid over the walls that all else has met, as a scan is matched with a map
(Olson 2009), half a metre to and fro: more of it lies on them where the stretch belongs.
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass

import numpy as np

from companion.estimation.association.gating import MIN_COS_INCIDENCE
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import (
    Array,
    Indices,
    Measured,
    Sightings,
    Unknowns,
    project,
    reach_m,
)

SPANS_S = (60.0, 120.0, 240.0, 480.0)
"""How long the stretches are; each half overlaps the next."""
MIN_LENGTH_S = 15.0
RAMP_S = 15.0
"""The flight before and after a stretch leads over to it: 3 cm a second at most."""
MAX_M, STEP_M = 0.8, 0.1
EXACT_M = 0.06
"""Hits with a larger sigma tell nothing."""
ON_WALL_M, BEYOND_END_M = 0.05, 0.1
"""So near to a wall, besides one sigma, and to its ends, a hit is on it."""
MIN_HITS, MAX_HITS = 100, 400
"""Of a stretch; a sample of more tells as much."""
MIN_HITS_ELSEWHERE = 8
"""From outside of the stretch, on a wall that it may be laid over."""
MIN_GAIN = 0.05
"""The share of a stretch's hits that have to lie on walls only where it is shifted to."""


@dataclass(frozen=True, slots=True)
class Shift:
    """A stretch, and where it would fit better."""

    begin_s: float
    end_s: float
    by_ne_m: Array
    """(2,)."""
    gain: float
    """The share of its hits that lie on walls then, less the share that does now."""


def shifts(
    estimate: Estimate, m: Measured, units: RangeUnits
) -> Generator[None, None, list[Shift]]:
    """Those that gain most first, in pieces of some milliseconds: it yields after each."""
    x, seen = estimate.x, project(estimate.x, m)
    time_s, sigma_m = m.time_s[m.frame], units.sigma_m(m.beam, m.distance_m)
    found = []
    for begin_s, end_s in _stretches(float(time_s.max(initial=0.0))):
        inside = (time_s >= begin_s) & (time_s < end_s)
        exact: Indices = np.flatnonzero(inside & (sigma_m < EXACT_M))
        if len(exact) < MIN_HITS:
            continue
        some = exact[np.linspace(0, len(exact) - 1, min(len(exact), MAX_HITS)).astype(int)]
        elsewhere = np.where(inside, NO_WALL, estimate.wall_of)
        shares = _shares_on_walls(x, seen, sigma_m, some, elsewhere)
        best = int(shares.argmax())
        gain = float(shares[best] - shares[len(shares) // 2])
        found.append(Shift(begin_s, end_s, _BY_NE_M[best], gain))
        yield
    worth = (shift for shift in found if shift.gain > MIN_GAIN)
    return sorted(worth, key=lambda shift: -shift.gain)


def shifted(x: Unknowns, m: Measured, shift: Shift) -> Unknowns:
    """With the stretch where it would fit better, and gradual ways there and back."""
    moved = x.since(0)
    ends_s = shift.begin_s - RAMP_S, shift.begin_s, shift.end_s, shift.end_s + RAMP_S
    share = np.interp(m.time_s, ends_s, (0.0, 1.0, 1.0, 0.0))
    moved.poses[:, :2] += share[:, None] * shift.by_ne_m
    return moved


def _places_ne_m() -> Array:
    """(s, 2): all shifts that are tried, none at all in the middle."""
    steps_m = STEP_M * np.arange(-round(MAX_M / STEP_M), round(MAX_M / STEP_M) + 1)
    return np.stack(np.meshgrid(steps_m, steps_m, indexing="ij"), axis=-1).reshape(-1, 2)


_BY_NE_M = _places_ne_m()


def _stretches(length_s: float) -> Iterator[tuple[float, float]]:
    for span_s in SPANS_S:
        for begin_s in np.arange(0.0, length_s - MIN_LENGTH_S, span_s / 2).tolist():
            yield begin_s, begin_s + span_s


def _shares_on_walls(
    x: Unknowns, seen: Sightings, sigma_m: Array, some: Indices, wall_of: Indices
) -> Array:
    """(s,): for each shift the share of some hits that lie on walls, as far as `wall_of` tells."""
    met = np.bincount(wall_of[wall_of != NO_WALL], minlength=len(x.walls))
    walls: Indices = np.flatnonzero(met >= MIN_HITS_ELSEWHERE)
    low_m, high_m = reach_m(x, seen.points, wall_of)[walls].T
    normals, tangents = x.normals[walls], x.tangents[walls]
    off_m = seen.points[some] @ normals.T - x.walls[walls, 1]
    faces = seen.beams[some] @ normals.T > MIN_COS_INCIDENCE
    hit, wall = np.nonzero(faces & (np.abs(off_m) < 2 * MAX_M))
    if not len(hit):
        return np.zeros(len(_BY_NE_M))
    along_m = (seen.points[some][hit] * tangents[wall]).sum(axis=1)[:, None]
    along_m = along_m + tangents[wall] @ _BY_NE_M.T
    across_m = off_m[hit, wall][:, None] + normals[wall] @ _BY_NE_M.T
    is_on = np.abs(across_m) < ON_WALL_M + sigma_m[some][hit][:, None]
    is_on &= along_m > low_m[wall][:, None] - BEYOND_END_M
    is_on &= along_m < high_m[wall][:, None] + BEYOND_END_M
    firsts = np.flatnonzero(np.diff(hit, prepend=-1))
    shares: Array = np.logical_or.reduceat(is_on, firsts, axis=0).sum(axis=0) / len(some)
    return shares
