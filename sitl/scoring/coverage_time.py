"""Finds when a flight, or a team, had seen which share of the walls."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from companion.core.arrays import Array
from companion.core.messages import Hit
from sitl.core.truth import TrueState
from sitl.scoring.score import to_world

SEEN_WITHIN_M = 0.25
"""A true wall is seen by a reading on a mapped wall within this distance, m. Chosen: a map turned
by 1° is off so far at 15 m."""


def first_seen_s(
    hits: Sequence[Hit], times_s: Sequence[float], observable: Array, take_off: TrueState
) -> Array:
    """(n,): time at which each sample (n, 2) of the observable walls was first seen, in order, s.

    Infinite if it never was. `times_s` are the times of the hits.
    """
    on_walls = [number for number, hit in enumerate(hits) if hit.wall is not None]
    if not on_walls:
        return np.full(len(observable), math.inf)
    places = np.array([hits[number].position_ned_m[:2] for number in on_walls])
    when_s = np.array([times_s[number] for number in on_walls])
    near = cKDTree(to_world(places, take_off)).query_ball_point(observable, SEEN_WITHIN_M)
    first = [when_s[each].min() if each else math.inf for each in near]
    return np.sort(np.array(first))


def time_to_see_s(seen_s: Array, share: float) -> float:
    """Time, s, at which a share of the samples was seen; infinite if it never was."""
    return float(seen_s[min(math.ceil(share * len(seen_s)), len(seen_s)) - 1])
