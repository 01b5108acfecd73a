"""The true walls seen from above, at one height."""

from companion.frames import Vector2
from sitl.world.format import World


def wall_surfaces(world: World, height_m: float) -> list[tuple[Vector2, Vector2]]:
    """Segments, (north, east) in metres, of every wall and box that stands at this height."""
    surfaces: list[tuple[Vector2, Vector2]] = []
    for walls in world.walls:
        top_m = world.height_m if walls.top_m is None else walls.top_m
        if walls.bottom_m <= height_m <= top_m:
            surfaces += walls.segments
    for box in world.boxes:
        if box.bottom_m <= height_m <= box.top_m:
            surfaces += box.segments
    return surfaces
