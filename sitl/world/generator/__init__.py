"""Generates a random building from a seed, similar to a floor of a house or office.

    floor ─► rooms, walls, doorways ──┐
    furniture ─► boxes, slanted walls ┴─► World, with starts in different rooms

Coordinates are on a grid of 10 cm and use only +, -, ×, ÷ and √, so a seed gives the same building
on every machine.
"""

import random
import re
from typing import TYPE_CHECKING

from sitl.core.noise import stream
from sitl.world.format import Door, Start, Walls, World
from sitl.world.generator.floor import Floor, random_floor

if TYPE_CHECKING:
    from sitl.world.generator.furniture import Space

CEILINGS_M = (2.4, 2.5, 2.6, 2.7, 2.8, 3.0)
"""Ceiling heights drawn, m. Chosen."""
THICKNESSES_M = (0.1, 0.12, 0.15, 0.2)
"""Wall thicknesses drawn, m. Chosen."""
MAX_STARTS = 3
"""Largest number of starts. Chosen."""

_NAME = re.compile(r"random_(?P<large>large_)?(?P<seed>0|[1-9]\d{0,17})")


def named(name: str) -> World | None:
    """The building of a name such as `random_17` or `random_large_17`; None for other names."""
    match = _NAME.fullmatch(name)
    return random_world(int(match["seed"]), is_large=bool(match["large"])) if match else None


def random_world(seed: int, *, is_large: bool = False) -> World:
    """The building for a seed."""
    from sitl.world.generator.furniture import Space, furnish  # noqa: PLC0415 - slow to load

    rng = stream(seed, "building")
    height_m = rng.choice(CEILINGS_M)
    thickness_m = rng.choice(THICKNESSES_M)
    floor = random_floor(rng, is_large=is_large)
    spaces = [Space(room, floor.doorways, thickness_m) for room in floor.rooms]
    furnish(spaces, height_m, rng)
    slanted = [
        Walls(points=wall, thickness_m=thickness_m) for space in spaces for wall in space.slanted
    ]
    return World(
        name=f"random_{'large_' if is_large else ''}{seed}",
        height_m=height_m,
        walls=(*_walls(floor, thickness_m), *slanted),
        boxes=tuple(box for space in spaces for box in space.boxes),
        starts=_starts(spaces, rng),
    )


def _walls(floor: Floor, thickness_m: float) -> list[Walls]:
    """The outer walls and the inner ones with their doors."""
    (south, west), (north, east) = floor.outline.low, floor.outline.high
    corners = (south, west), (north, west), (north, east), (south, east)
    walls = [Walls(points=corners, closed=True, thickness_m=thickness_m)]
    for number, wall in enumerate(floor.walls):
        doors = tuple(
            Door(centre=doorway.centre, width_m=doorway.width_m, height_m=doorway.height_m)
            for doorway in floor.doorways
            if doorway.wall == number
        )
        walls.append(Walls(points=wall, thickness_m=thickness_m, doors=doors))
    return walls


def _starts(spaces: "list[Space]", rng: random.Random) -> tuple[Start, ...]:
    """Starts in different rooms; the flight's seed draws the heading."""
    numbers = list(range(len(spaces)))
    rng.shuffle(numbers)
    chosen = numbers[: rng.randint(1, MAX_STARTS)]
    return tuple(
        Start(name=f"room {number + 1}", position=rng.choice(spaces[number].standing_room()))
        for number in chosen
    )
