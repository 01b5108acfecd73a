"""A clean world made lived-in: the same walls, with doors, furniture and curtains before them.

    World ─► standing ─► FreeFloor ◄─ take? ─┬─ leaves: doors that stand open
                             │               ├─ along_walls: jagged walls, curtains
                             │               └─ furniture: on legs, on poles, on end
    World with the pieces ◄──┘

A piece that would stand on another, within the free circle of a start, or in the only way to a
place is left out. Places are drawn only by +, -, ×, ÷ and √ and rounded to millimetres.
"""

from collections.abc import Iterable

from sitl.noise import stream
from sitl.world.clutter.along_walls import curtains, jags
from sitl.world.clutter.free_floor import FreeFloor
from sitl.world.clutter.furniture import furniture
from sitl.world.clutter.leaves import leaves
from sitl.world.clutter.pieces import Piece
from sitl.world.clutter.standing import faces_of
from sitl.world.format import World, WorldError


def cluttered(world: World, difficulty: float, seed: int) -> World:
    """The world with clutter in it; 0 is the world itself, 0.5 a lived-in flat, 1 crammed.

    The same world, difficulty and seed make the same clutter, to the bit.

    Raises:
        WorldError: the difficulty is not from 0 to 1, or a start has no room to take off.
    """
    if not 0 <= difficulty <= 1:
        raise WorldError(f"clutter {difficulty:g}: from 0 to 1")
    if difficulty == 0:
        return world
    floor = FreeFloor(world)
    faces = faces_of(world, floor)
    pieces = [
        *leaves(world, floor, difficulty, stream(seed, "clutter doors")),
        *curtains(faces, floor, difficulty, stream(seed, "clutter curtains")),
        *jags(faces, floor, difficulty, stream(seed, "clutter jags")),
        *furniture(world, faces, floor, difficulty, stream(seed, "clutter furniture")),
    ]
    return _with(world, pieces, f"{world.name}_clutter_{difficulty:g}")


def _with(world: World, pieces: Iterable[Piece], name: str) -> World:
    """The pieces after what the world has already."""
    walls = tuple(wall for piece in pieces for wall in piece.walls)
    return world.model_copy(update={"name": name, "walls": (*world.walls, *walls)})
