"""What `sitl world check` says of a world: its size, what is known of it, and what to beware."""

from sitl.world.format import World, WorldError
from sitl.world.geometry.model import WorldModel
from sitl.world.known import KnownArea

MIN_START_CLEARANCE_M = 0.6
START_HEIGHT_M = 1.2
MAX_UNKNOWN = 0.5
"""Of what could be reached; with more, the scores are of the smaller part of a building."""
MIN_REACHED = 0.5
"""Of what is known to be free."""


def facts(world: World) -> list[str]:
    """Lines that say what there is.

    Raises:
        WorldError: a start is not free.
    """
    north_m, east_m = extent(world)
    size = f"{world.name}: {north_m:.4g} × {east_m:.4g} m, {world.height_m:.3g} m high"
    return [size, *_of_known(world.known), *_of_starts(world)]


def warnings(world: World) -> list[str]:
    """What does not keep a drone from flying there, but should be known of the scores."""
    known = world.known
    if known is None:
        return []
    found = []
    if known.unknown_share > MAX_UNKNOWN:
        found.append(
            f"{known.unknown_share:.0%} of what could be reached is unknown, and cut off along "
            f"{known.border_m:.1f} m of closed border: the map is of a part of its building, or "
            "glass and open doors are gaps in its walls; map more of it, or draw them in"
        )
    if known.reached_m2 < MIN_REACHED * known.free_m2:
        found.append(
            f"only {known.reached_m2:.1f} of {known.free_m2:.1f} m² that are known to be free can "
            "be reached from start 1; the rest lies behind openings narrower than a door, or in "
            "strips that single beams went through"
        )
    return found


def extent(world: World) -> tuple[float, float]:
    """Length to the north and to the east, metres."""
    (south, west), (north, east) = world.bounds
    return north - south, east - west


def _of_known(known: KnownArea | None) -> list[str]:
    if known is None:
        return []
    lines = [
        "the map tells no heights: all that stands reaches up to the ceiling",
        f"known to be free: {known.free_m2:.1f} m², of which {known.reached_m2:.1f} m² can be "
        "reached from start 1",
        f"unknown: {known.unknown_share:.0%} of what could be reached if unknown cells were air",
    ]
    if known.border:
        lines.append(
            f"border to the unknown closed: {known.border_m:.1f} m; nobody gets through, "
            "and no score counts it"
        )
    return lines


def _of_starts(world: World) -> list[str]:
    model = WorldModel(world)
    lines = []
    for start in world.starts:
        clearance_m = model.clearance_m((*start.position, -START_HEIGHT_M))
        if clearance_m < MIN_START_CLEARANCE_M:
            raise WorldError(
                f"{world.name}: start {start.name!r} has {clearance_m:.2f} m around it; "
                f"{MIN_START_CLEARANCE_M} m are needed, move it"
            )
        north_m, east_m = start.position
        lines.append(
            f"{start.name}: {north_m:.2f} m north, {east_m:.2f} m east, {clearance_m:.2f} m around"
        )
    return lines
