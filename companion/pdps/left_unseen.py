"""What is left unseen when nothing more can be looked at: openings that are too narrow, mostly."""

import numpy as np
from scipy.ndimage import distance_transform_edt, label

from companion.mapping.occupancy import CELL_M, Occupancy
from companion.pdps.frontiers import SQUARE, Places, centres, edges, without_specks
from companion.pdps.viewpoints import NEAR_SOMETHING_M

MIN_OPENING_CELLS = 4
"""Of 10 cm, without those that touch the jambs. Chosen: behind less there is hardly a place."""
MAX_NAMED = 3
"""What a pilot reads at a glance."""


def left_unseen(space: Occupancy) -> Places:
    """The middle of each edge of what is known, the longest first; not of the open, without end."""
    near = distance_transform_edt(~space.occupied) * CELL_M <= NEAR_SOMETHING_M
    numbers, count = label(without_specks(edges(space) & near, MIN_OPENING_CELLS), SQUARE)
    parts = [np.argwhere(numbers == number) for number in range(1, count + 1)]
    parts.sort(key=len, reverse=True)
    middles = np.array([part[len(part) // 2] for part in parts]).reshape(-1, 2)
    return tuple((float(north_m), float(east_m)) for north_m, east_m in centres(space, middles))


def in_words(places: Places) -> str:
    """Where they are from the start, its first heading being north; empty if there are none."""
    named = [_way(*place) for place in places[:MAX_NAMED]]
    more = f" and {len(places) - MAX_NAMED} more" if len(places) > MAX_NAMED else ""
    return f"left unseen: {', '.join(named)}{more}" if named else ""


def _way(north_m: float, east_m: float) -> str:
    north = f"{abs(north_m):.1f} m {'north' if north_m >= 0 else 'south'}"
    return f"{north} {abs(east_m):.1f} m {'east' if east_m >= 0 else 'west'}"
