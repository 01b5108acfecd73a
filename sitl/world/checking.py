"""Builds the output of `sitl world check`: a world's size, its known area, and warnings."""

from sitl.world.format import World, WorldError
from sitl.world.geometry.model import WorldModel
from sitl.world.known import KnownArea

MIN_START_CLEARANCE_M = 0.6
"""Smallest clearance around a start, m. Chosen."""
START_HEIGHT_M = 1.2
"""Height at which that clearance is measured, m: the usual mission height."""
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
    return [size, *_of_known(world.known), *_of_starts(world)]


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
