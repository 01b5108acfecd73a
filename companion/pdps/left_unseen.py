"""Lists the places that are still unseen after the exploration: mostly openings too narrow."""

import numpy as np
from scipy.ndimage import distance_transform_edt, label

from companion.mapping.occupancy import CELL_M, Occupancy
from companion.pdps.frontiers import SQUARE, Places, centres, edges, without_specks
from companion.pdps.viewpoints import NEAR_SOMETHING_M

MIN_OPENING_CELLS = 4
"""Minimum length of a listed edge, in cells of 10 cm, without those that touch the jambs.
Chosen: a smaller opening rarely has a room behind it."""
MAX_NAMED = 3
"""Maximum number of places in the message. Chosen: a pilot reads that many at a glance."""


def left_unseen(space: Occupancy) -> Places:
    """Middles of the edges of known space near obstacles, local NED, m; the longest edge first.

    Edges in the open, far from any obstacle, are not listed.
    """
    near = distance_transform_edt(~space.occupied) * CELL_M <= NEAR_SOMETHING_M
    numbers, count = label(without_specks(edges(space) & near, MIN_OPENING_CELLS), SQUARE)
    parts = [np.argwhere(numbers == number) for number in range(1, count + 1)]
    parts.sort(key=len, reverse=True)
    middles = np.array([part[len(part) // 2] for part in parts]).reshape(-1, 2)
    return tuple((float(north_m), float(east_m)) for north_m, east_m in centres(space, middles))


def in_words(places: Places) -> str:
    """Message with the places relative to the start, first heading north; empty without places."""
    named = [_way(*place) for place in places[:MAX_NAMED]]
    more = f" and {len(places) - MAX_NAMED} more" if len(places) > MAX_NAMED else ""
    return f"left unseen: {', '.join(named)}{more}" if named else ""


def _way(north_m: float, east_m: float) -> str:
    north = f"{abs(north_m):.1f} m {'north' if north_m >= 0 else 'south'}"
    return f"{north} {abs(east_m):.1f} m {'east' if east_m >= 0 else 'west'}"
