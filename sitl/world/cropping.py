"""Crops a square piece out of a world that is too large for one flight."""

import math
from dataclasses import replace

from companion.core.frames import Vector2
from sitl.world.format import MIN_LENGTH_M, Box, Panel, Segment, Start, Walls, World, WorldError
from sitl.world.known import KnownArea

MIN_TO_BORDER_M = 0.6
"""Starts nearer to the border are dropped, m. Chosen."""


def cropped(world: World, side_m: float, start: int) -> World:
    """The square of this side around a start pose, which becomes the first start.

    Walls and boxes end at the square's border. The border is a wall, so a drone cannot leave, also
    where the plan is open.

    Raises:
        WorldError: the world is a mesh.
    """
    centre = world.starts[start]
    if world.mesh is not None:
        raise WorldError(f"{world.name}: a mesh cannot be cropped")
    north, east = centre.position
    low = north - side_m / 2, east - side_m / 2
    high = north + side_m / 2, east + side_m / 2
    border = Walls(points=(low, (high[0], low[1]), high, (low[0], high[1])), closed=True)
    return World(
        name=world.name,
        height_m=world.height_m,
        walls=(border, *_walls_within(world.panels, low, high)),
        boxes=tuple(box for whole in world.boxes if (box := _box_within(whole, low, high))),
        starts=(centre, *(s for s in world.starts if s is not centre and _is_in(s, low, high))),
        known=_known_within(world.known, low, high),
    )


def _known_within(known: KnownArea | None, low: Vector2, high: Vector2) -> KnownArea | None:
    """Clip the closed border to the square; the known cells stay."""
    if known is None:
        return None
    pieces = (_segment_within(segment, low, high) for segment in known.border)
    border = tuple(piece for piece in pieces if piece)
    return replace(known, border=border, border_m=sum(math.dist(*piece) for piece in border))


def _is_in(start: Start, low: Vector2, high: Vector2) -> bool:
    return all(
        low[axis] + MIN_TO_BORDER_M <= start.position[axis] <= high[axis] - MIN_TO_BORDER_M
        for axis in (0, 1)
    )


def _walls_within(panels: list[Panel], low: Vector2, high: Vector2) -> list[Walls]:
    """Clip the walls to the square. Doors are already cut out of the panels."""
    return [
        Walls(
            points=segment,
            thickness_m=panel.thickness_m,
            bottom_m=panel.bottom_m,
            top_m=panel.top_m,
            glass=panel.glass,
        )
        for panel in panels
        if (segment := _segment_within((panel.start, panel.end), low, high))
    ]


def _segment_within(segment: Segment, low: Vector2, high: Vector2) -> Segment | None:
    """Clip a line to a rectangle, by Liang and Barsky; None if almost nothing remains."""
    start, end = segment
    along = end[0] - start[0], end[1] - start[1]
    enters, leaves = 0.0, 1.0
    for axis in (0, 1):
        if along[axis] == 0:
            if not low[axis] <= start[axis] <= high[axis]:
                return None
            continue
        to_low = (low[axis] - start[axis]) / along[axis]
        to_high = (high[axis] - start[axis]) / along[axis]
        enters = max(enters, min(to_low, to_high))
        leaves = min(leaves, max(to_low, to_high))
    length_m = (along[0] ** 2 + along[1] ** 2) ** 0.5
    if (leaves - enters) * length_m < 2 * MIN_LENGTH_M:
        return None
    return _along(segment, enters), _along(segment, leaves)


def _along(segment: Segment, share: float) -> Vector2:
    """The point at a share of the segment; exactly its end at 1."""
    (north, east), end = segment
    if share == 1.0:
        return end
    return north + share * (end[0] - north), east + share * (end[1] - east)


def _box_within(box: Box, low: Vector2, high: Vector2) -> Box | None:
    corner = max(box.corner[0], low[0]), max(box.corner[1], low[1])
    size = (
        min(box.corner[0] + box.size[0], high[0]) - corner[0],
        min(box.corner[1] + box.size[1], high[1]) - corner[1],
    )
    if min(size) < MIN_LENGTH_M:
        return None
    return box.model_copy(update={"corner": corner, "size": size})
