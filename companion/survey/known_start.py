"""Places flights that began on the pad, or at another known place, and solves them together.

A flight that knew the map of earlier ones lies in their frame, as seen from its pad. Another one is
placed by its walls.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from companion.core.arrays import Array
from companion.estimation.placement import refined_start
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.joint import moved_to
from companion.estimation.smoothing.state import Unknowns
from companion.survey.flights import (
    MAX_START_SIGMAS,
    Flown,
    Joint,
    LeftOut,
    Placed,
    off_the_pad,
    worst_misfit,
)


def solved_from_pad(
    flights: Sequence[Flown], pad_sigma: Array, given: Mapping[str, Array]
) -> tuple[Joint, list[LeftOut]]:
    """The joint solution, and the flights that do not fit.

    `pad_sigma` (3,): sigmas of a start: north, east, m, and heading, rad. `given`: starts (3,) of
    flights that began elsewhere than the first, by name.
    """
    placed, left_out = _placed(flights, pad_sigma, given)
    while True:
        joint = Joint.of(placed)
        misfit = worst_misfit(joint)
        if misfit is None:
            return joint, left_out
        number, reason = misfit
        left_out.append(LeftOut(placed.pop(number).flown.name, reason))


def _placed(
    flights: Sequence[Flown], pad_sigma: Array, given: Mapping[str, Array]
) -> tuple[list[Placed], list[LeftOut]]:
    """The flights, each placed by its walls in the map of those before; and those off the pad."""
    placed: list[Placed] = []
    left_out: list[LeftOut] = []
    known: Unknowns | None = None
    for each in flights:
        pad, x = given.get(each.name, np.zeros(3)), each.x.since(0)
        if each.knows_earlier_flights:
            wall_of = each.wall_of
            x.keep_walls(np.unique(wall_of[wall_of != NO_WALL]), wall_of)
            x = moved_to(x, pad)
        elif known is not None:
            start = refined_start(x, known, pad, pad_sigma)
            if (np.abs(start - pad) > MAX_START_SIGMAS * pad_sigma).any():
                left_out.append(LeftOut(each.name, off_the_pad(start - pad, pad_sigma)))
                continue
            x = moved_to(x, start)
        if known is None:
            known = x.since(0)
        else:
            known.add_walls(x.walls, x.reach_m)
        placed.append(Placed(each, x, pad, pad_sigma))
    return placed, left_out
