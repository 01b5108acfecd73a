"""Builds the output of `sitl world check`: a world's size and space, its known area, warnings."""

import numpy as np
from scipy import ndimage

from companion.core.arrays import Array
from sitl.world.format import World, WorldError
from sitl.world.geometry.model import WorldModel
from sitl.world.known import KnownArea
from sitl.world.plan import CELL_M, NARROWEST_DOOR_M, reachable

MIN_START_CLEARANCE_M = 0.6
"""Smallest clearance around a start, m. Chosen."""
START_HEIGHT_M = 1.2
"""Height at which that clearance is measured, m: the usual mission height."""
WIDEST_DOOR_M = 1.4
"""Openings up to this width separate rooms, m: the widest door of random buildings."""
MIN_ROOM_M2 = 1.0
"""Least area of a room, without a margin of half a door along its walls, m². Chosen."""
MAX_UNKNOWN = 0.5
"""Unknown share of the reachable area from which a warning is given. With more, the scores cover
the smaller part of a building. Chosen."""
MIN_REACHED = 0.5
"""Reachable share of the free area below which a warning is given. Chosen."""


def facts(world: World) -> list[str]:
    """Lines with the world's size, known area and starts.

    Raises:
        WorldError: a start has too little clearance.
    """
    north_m, east_m = extent(world)
    size = f"{world.name}: {north_m:.4g} × {east_m:.4g} m, {world.height_m:.3g} m high"
    starts = _of_starts(world)
    return [size, _of_space(world), *_of_known(world.known), *starts]


def warnings(world: World) -> list[str]:
    """Warnings. They do not prevent a flight, but they limit what the scores mean."""
    known = world.known
    if known is None:
        return []
    found = []
    if known.unknown_share > MAX_UNKNOWN:
        found.append(
            f"{known.unknown_share:.0%} of the reachable area is unknown, and cut off along "
            f"{known.border_m:.1f} m of closed border: the map covers part of its building, or "
            "glass and open doors are gaps in its walls; map more of it, or draw them in"
        )
    if known.reached_m2 < MIN_REACHED * known.free_m2:
        found.append(
            f"only {known.reached_m2:.1f} of {known.free_m2:.1f} m² that are known to be free can "
            "be reached from start 1; the rest lies behind openings narrower than a door, or in "
            "strips that single beams have crossed"
        )
    return found


def extent(world: World) -> tuple[float, float]:
    """Length to the north and to the east, m."""
    (south, west), (north, east) = world.bounds
    return north - south, east - west


def _of_space(world: World) -> str:
    """The area that a drone reaches from the first start, and the number of rooms in it."""
    start = world.starts[0]
    places = reachable(world, START_HEIGHT_M, start.position)
    low, high = np.array(world.bounds)
    is_inside = ((places > low) & (places < high)).all(axis=1)
    where = f"reachable from {start.name} at {START_HEIGHT_M} m"
    if not is_inside.any():
        return f"{where}: the outside only"
    area_m2, rooms = _area_and_rooms(places[is_inside])
    parts = "1 room" if rooms == 1 else f"{rooms} rooms behind openings of up to {WIDEST_DOOR_M} m"
    outside = "" if is_inside.all() else "; and the outside, through gaps in the walls"
    return f"{where}: about {area_m2:.0f} m², {parts}{outside}"


def _area_and_rooms(places: Array) -> tuple[float, int]:
    """Area with the margin along the walls, m², and number of rooms of reachable places (n, 2)."""
    row, column = np.round((places - places.min(axis=0)) / CELL_M).astype(np.int64).T
    free = np.zeros((row.max() + 1, column.max() + 1), dtype=bool)
    free[row, column] = True
    free = np.pad(free, 1 + round(NARROWEST_DOOR_M / CELL_M))
    to_wall_m = NARROWEST_DOOR_M / 2  # of the outermost of these cells
    inside_m = ndimage.distance_transform_edt(free) * CELL_M
    outside_m = ndimage.distance_transform_edt(~free) * CELL_M
    room, count = ndimage.label(inside_m + to_wall_m > WIDEST_DOOR_M / 2 + CELL_M / 2)
    cells = np.bincount(room.ravel(), minlength=count + 1)[1:]
    rooms = int(np.count_nonzero(cells * CELL_M**2 >= MIN_ROOM_M2))
    return float(np.count_nonzero(outside_m < to_wall_m)) * CELL_M**2, rooms


def _of_known(known: KnownArea | None) -> list[str]:
    if known is None:
        return []
    lines = [
        "the map has no heights: every wall reaches the ceiling",
        f"known to be free: {known.free_m2:.1f} m², of which {known.reached_m2:.1f} m² can be "
        "reached from start 1",
        f"unknown: {known.unknown_share:.0%} of the area reachable if unknown cells were free",
    ]
    if known.border:
        lines.append(
            f"border to the unknown closed: {known.border_m:.1f} m; impassable, "
            "and ignored by the scores"
        )
    return lines


def _of_starts(world: World) -> list[str]:
    model = WorldModel(world)
    lines = []
    for start in world.starts:
        clearance_m = model.clearance_m((*start.position, -START_HEIGHT_M))
        if clearance_m < MIN_START_CLEARANCE_M:
            raise WorldError(
                f"{world.name}: start {start.name!r} has {clearance_m:.2f} m of clearance; "
                f"{MIN_START_CLEARANCE_M} m are needed, move it"
            )
        north_m, east_m = start.position
        lines.append(
            f"{start.name}: {north_m:.2f} m north, {east_m:.2f} m east, clearance "
            f"{clearance_m:.2f} m"
        )
    return lines
