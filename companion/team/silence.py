"""Decides who flies on when drones of a team do not know where the others are.

A silent drone may have crashed, may be out of range, or may fly on with a broken radio: nobody can
tell. Nobody knows where it is, and four beams do not see another drone in time. So of two drones
that do not hear each other only one may move:

    both are reached through others, or the      ─► the one with the lowest number flies on. The
    drones that reach each other are as many as      other holds its place for `HOLDS_S`, and then
    those that are cut off                           flies on alone: by then the first one is home
    those that reach each other are more         ─► they fly on, and those that are cut off hold

A drone on its way home does not hold: the others hold until it must be down.

The same holds for drones whose maps contradict each other, because one is not on its pad, or its
estimate is wrong: nobody knows where the other one is. They can tell each other, so who has not the
right to move lands at once.
"""

import math
from collections.abc import Collection, Mapping

from companion.config.team import MAX_DRONES
from companion.core.values import value

HOLDS_S = 300.0
"""Time for which one of two drones holds its place because it does not hear the other, s; the other
is home by then. Chosen: half of the default of `mission.time_limit_s`, a share for each."""
LANDS_S = 70.0
"""After this time a drone that was on its way home is down, s. Chosen: more than a minute."""


@value
class Silent:
    """A drone that was in the air when it was heard last."""

    since_s: float
    """When it was heard last, s."""
    goes_home: bool


@value
class Right:
    """Who moves."""

    holds: bool = False
    """This drone holds its place."""
    home_by_s: float = math.inf
    """Time at which this drone must be home, because another one flies on then, s."""
    others_hold: frozenset[int] = frozenset()
    """The silent drones that hold their places."""


def reached(told: Mapping[int, Mapping[int, int]], own: int) -> dict[int, int]:
    """The drones that this one reaches, and over how many radio links.

    `told`: what each drone that is heard has told of the same. A way that has broken becomes longer
    with each message, until it has more links than there are drones.
    """
    links = dict.fromkeys(told, 1)
    for through in told.values():
        for drone, more in through.items():
            if drone != own and more < MAX_DRONES - 1:
                links[drone] = min(links.get(drone, MAX_DRONES), more + 1)
    return links


def right_to_move(
    own: int, now_s: float, silent: Mapping[int, Silent], reaches: Collection[int]
) -> Right:
    """Who may move.

    `own`: the number of this drone. `silent`: the drones that it does not hear. `reaches`: those in
    the air that it reaches, also through others.
    """
    together = {own, *reaches}
    cut_off = silent.keys() - together
    is_even = len(together) == len(cut_off)
    holds, home_by_s, others_hold = False, math.inf, set[int]()
    for number, other in silent.items():
        age_s = now_s - other.since_s
        is_reached = number in together
        comes_first = own < number if is_reached else _comes_first(together, cut_off)
        by_turns = is_reached or is_even
        if other.goes_home:
            holds |= age_s < LANDS_S
        elif not comes_first:
            holds |= age_s < HOLDS_S or not by_turns
        else:
            others_hold |= {number} if age_s < HOLDS_S else set()
            home_by_s = min(home_by_s, other.since_s + HOLDS_S) if by_turns else home_by_s
    return Right(holds, home_by_s, frozenset(others_hold))


def must_land(own: int, agree: Collection[int], contradict: Collection[int]) -> bool:
    """True if this drone lands because its map contradicts those of others.

    `own`: its number. `agree`, `contradict`: the drones in the air, by their maps.
    """
    return not _comes_first({own, *agree}, contradict)


def _comes_first(group: Collection[int], other: Collection[int]) -> bool:
    """True if a group of drones flies on, and the other one does not.

    The larger one does, or that with the lowest number if both are as large.
    """
    if len(group) != len(other):
        return len(group) > len(other)
    return min(group) < min(other)
