"""Finds starts in a plan without any."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial import cKDTree

from companion.core.arrays import Array, Indices
from companion.core.frames import Vector2
from sitl.world.format import Segment, WorldError
from sitl.world.plan import samples

MIN_CLEARANCE_M = 0.6
"""Smallest clearance of a start, m, as `sitl world check` requires."""
MAX_CLEARANCE_M = 3.0
"""More clearance than this does not make a place better, m. Chosen."""
STEP_M = 0.4
"""Spacing of the places checked, m. Chosen."""
STARTS = 3
"""Largest number of starts. Chosen."""
APART_M = 3.0
"""Smallest distance between two starts, m. Chosen."""
RAYS = 16
"""Directions checked around a place."""
MIN_ENCLOSED = 12
"""Directions of `RAYS` that must hit a wall; otherwise the place is outside. Chosen."""


def anywhere(place: Vector2) -> bool:
    """Accept every place: for plans with walls only."""
    return True


def all_alike(places: Array) -> Indices:
    """Rank all places equally: for plans without distinct areas."""
    return np.zeros(len(places), dtype=np.int64)


def free_starts(
    segments: list[Segment],
    source: str,
    is_free: Callable[[Vector2], bool] = anywhere,
    rank: Callable[[Array], Indices] = all_alike,
    closed: Sequence[Segment] = (),
) -> list[dict[str, object]]:
    """Up to three enclosed places with clearance, apart from each other, best first.

    `is_free` may reject a place for reasons that the plan's walls do not show. `rank` returns the
    area rank (n,) of places (n, 2): lower ranks come first, -1 rejects. `closed` are segments that
    block the way without being walls.

    Raises:
        WorldError: there is no such place.
    """
    walls = np.array(segments, dtype=float)
    places = _grid(walls)
    roughly, _ = cKDTree(samples([*segments, *closed])).query(
        places, distance_upper_bound=MAX_CLEARANCE_M
    )
    rank_of = rank(places)
    order = np.lexsort((-np.minimum(roughly, MAX_CLEARANCE_M), rank_of))
    order = order[(rank_of[order] >= 0) & (roughly[order] >= MIN_CLEARANCE_M)]
    in_the_way = np.array([*segments, *closed], dtype=float)
    chosen: list[Vector2] = []
    for index in order:
        if len(chosen) == STARTS:
            break
        place = float(places[index, 0]), float(places[index, 1])
        if (
            all(math.dist(place, other) >= APART_M for other in chosen)
            and is_free(place)
            and _clearance(places[index], in_the_way) >= MIN_CLEARANCE_M
            and _is_enclosed(places[index], walls)
        ):
            chosen.append(place)
    if not chosen:
        raise WorldError(f"{source}: no enclosed place with {MIN_CLEARANCE_M} m of clearance")
    return [{"name": f"start {i + 1}", "position": place} for i, place in enumerate(chosen)]


def _grid(walls: Array) -> Array:
    low, high = walls.min(axis=(0, 1)), walls.max(axis=(0, 1))
    step = max(STEP_M, float((high - low).max()) / 300)
    north = np.arange(low[0] + step, high[0], step)
    east = np.arange(low[1] + step, high[1], step)
    return np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1).reshape(-1, 2)


def _clearance(place: Array, walls: Array) -> float:
    """Distance of a place to the nearest wall, m."""
    start, along = walls[:, 0], walls[:, 1] - walls[:, 0]
    share = ((place - start) * along).sum(axis=1) / (along**2).sum(axis=1)
    foot = start + np.clip(share, 0, 1)[:, None] * along
    return float(np.linalg.norm(place - foot, axis=1).min())


def _is_enclosed(place: Array, walls: Array) -> bool:
    """Rays in nearly all directions hit a wall."""
    bearings = np.arange(RAYS) * math.tau / RAYS + 0.01
    ray = np.column_stack([np.cos(bearings), np.sin(bearings)])[:, None]
    start, along = walls[:, 0] - place, walls[:, 1] - walls[:, 0]
    cross = ray[..., 0] * along[:, 1] - ray[..., 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        share = (start[:, 0] * ray[..., 1] - start[:, 1] * ray[..., 0]) / cross
    meets = (distance > 0) & (share >= 0) & (share <= 1)
    return int(meets.any(axis=1).sum()) >= MIN_ENCLOSED
