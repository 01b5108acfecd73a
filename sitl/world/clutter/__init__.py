"""A clean world made lived-in: the same walls, with doors, furniture and curtains before them.

    World ─► standing ─► FreeFloor ◄─ take? ─┬─ leaves: doors that stand open
      │                                      ├─ along_walls: jagged walls, curtains
      ▼                                      └─ furniture: on legs, on poles, on end
    windows: glass in outer walls                     │
      └─────► World with the pieces ◄─────────────────┘

A piece that would stand on another, within the free circle of a start, or in the only way to a
place is left out. Places are drawn only by +, -, ×, ÷ and √ and rounded to millimetres.
"""

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
    from sitl.world.clutter.filling import filled  # noqa: PLC0415 - slow to load, seldom needed

    return filled(world, difficulty, seed)
