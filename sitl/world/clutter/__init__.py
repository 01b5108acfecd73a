"""Adds clutter to a world: the same walls, with doors, furniture and curtains before them.

    World ─► standing ─► FreeFloor ◄─ take? ─┬─ leaves: doors that stand open
      │                                      ├─ along_walls: jagged walls, curtains
      ▼                                      └─ furniture: on legs, on poles, on end
    windows: glass in outer walls                     │
      └─────► World with the pieces ◄─────────────────┘

A piece is dropped if it would overlap another one, stand in the free circle of a start, or block
the only way to a place. Coordinates use only +, -, ×, ÷ and √ and are rounded to millimetres.
"""

from sitl.world.format import World, WorldError


def cluttered(world: World, difficulty: float, seed: int) -> World:
    """Add clutter. Difficulty 0 returns the world itself, 0.5 is a lived-in flat, 1 the maximum.

    The same world, difficulty and seed give the same clutter, bit for bit.

    Raises:
        WorldError: the difficulty is not from 0 to 1, or a start has no room to take off.
    """
    if not 0 <= difficulty <= 1:
        raise WorldError(f"clutter {difficulty:g}: must be from 0 to 1")
    if difficulty == 0:
        return world
    from sitl.world.clutter.filling import filled  # noqa: PLC0415 - slow to load, seldom needed

    return filled(world, difficulty, seed)
