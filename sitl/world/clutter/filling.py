"""Adds all kinds of clutter to a world, those with a fixed place first."""

from collections.abc import Iterable

from sitl.core.noise import stream
from sitl.world.clutter.along_walls import curtains, jags
from sitl.world.clutter.free_floor import FreeFloor
from sitl.world.clutter.furniture import furniture
from sitl.world.clutter.leaves import doorways_of, leaves
from sitl.world.clutter.pieces import Piece
from sitl.world.clutter.standing import faces_of
from sitl.world.clutter.windows import with_windows
from sitl.world.format import World


def filled(world: World, difficulty: float, seed: int) -> World:
    """The world with clutter, for a difficulty above 0 and up to 1.

    Raises:
        WorldError: a start has no room to take off.
    """
    floor = FreeFloor(world)
    doorways = doorways_of(world, floor)
    world = with_windows(world, floor, difficulty, stream(seed, "clutter windows"))
    faces = faces_of(world, floor)
    pieces = [
        *leaves(doorways, floor, difficulty, stream(seed, "clutter doors")),
        *curtains(faces, floor, difficulty, stream(seed, "clutter curtains")),
        *jags(faces, floor, difficulty, stream(seed, "clutter jags")),
        *furniture(world, faces, floor, difficulty, stream(seed, "clutter furniture")),
    ]
    return _with(world, pieces, f"{world.name}_clutter_{difficulty:g}")


def _with(world: World, pieces: Iterable[Piece], name: str) -> World:
    """The world with further pieces."""
    walls = tuple(wall for piece in pieces for wall in piece.walls)
    return world.model_copy(update={"name": name, "walls": (*world.walls, *walls)})
