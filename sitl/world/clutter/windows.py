"""Adds windows to outer walls: panes that a beam passes, between posts that it detects.

A pane is narrower than the drone. The hull touches the posts before it can pass between them, so
the drone cannot leave where no sensor detects the glass.

    from above   ═══▐──▐──▐══      pane ──, post ▐, wall ═
"""

import random
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from math import dist

from sitl.world.clutter.free_floor import FreeFloor
from sitl.world.clutter.pieces import DECIMALS, Spot, slab
from sitl.world.clutter.standing import ASIDE_M, OFF_WALL_M
from sitl.world.format import Door, Panel, Walls, World

PANE_M = 0.25, 0.38
"""Width of a pane, m; the hull is 0.4 m wide."""
POST_M = 0.06
"""Width of the post between two panes, m: a window frame."""
PANES = 1, 4
"""Minimum and maximum number of panes in a window. Chosen."""
SILL_M, LINTEL_M = 0.9, 2.1
"""Heights of sill and lintel, m, as usual in dwellings; flight height is between them."""
MIN_ABOVE_M = 0.1
"""Height of wall over a window, m."""
WINDOWED_SHARE = 0.15
"""Share of the outer walls' length with windows at difficulty 1; none up to `FROM`. Chosen."""
FROM = 0.5
"""Difficulty from which windows are added. Chosen: no sensor detects glass."""
BESIDE_M = 0.15
"""Width of wall on either side of a window, m. Chosen."""
FAR_M = 1000.0
"""Distance behind an outer wall that must be empty, m."""
LOOKS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Shares of a wall's length at which both sides are checked. Chosen."""


@dataclass(frozen=True, slots=True)
class _Stretch:
    """A stretch of outer wall; its depth direction is into the room."""

    number: int
    """Number of its wall in the world."""
    spot: Spot
    length_m: float
    thickness_m: float

    def is_seen(self, x_m: float, floor: FreeFloor) -> bool:
        """There is free floor before it."""
        near_m, far_m = self.thickness_m / 2 + OFF_WALL_M, self.thickness_m / 2 + ASIDE_M
        return floor.is_open(self.spot.at(x_m, near_m), self.spot.at(x_m, far_m))

    def is_last(self, x_m: float, floor: FreeFloor) -> bool:
        """The space behind it is empty."""
        behind_m = self.thickness_m / 2 + OFF_WALL_M
        return floor.is_clear(self.spot.at(x_m, -behind_m), self.spot.at(x_m, -FAR_M))


@dataclass(frozen=True, slots=True)
class _Window:
    """Panes between posts."""

    spot: Spot
    panes: int
    pane_m: float

    @property
    def width_m(self) -> float:
        return round(self.panes * self.pane_m + (self.panes - 1) * POST_M, DECIMALS)

    @property
    def door(self) -> Door:
        """The opening, from the floor up."""
        return Door(centre=self.spot.place, width_m=self.width_m, height_m=LINTEL_M)

    def parts(self, thickness_m: float) -> Iterator[Walls]:
        """Sill, glass and posts in a wall of this thickness."""
        half_m = self.width_m / 2
        ends = self.spot.at(-half_m, 0.0), self.spot.at(half_m, 0.0)
        yield Walls(points=ends, thickness_m=thickness_m, top_m=SILL_M)
        yield Walls(points=ends, bottom_m=SILL_M, top_m=LINTEL_M, glass=True)
        thick_m = max(thickness_m, POST_M)
        for number in range(1, self.panes):
            middle = self.spot.moved(number * (self.pane_m + POST_M) - POST_M / 2 - half_m, 0.0)
            yield slab(middle, POST_M, thick_m, SILL_M, LINTEL_M)


def with_windows(world: World, floor: FreeFloor, difficulty: float, rng: random.Random) -> World:
    """The world with windows cut into its outer walls."""
    stretches = list(_outer(world, floor))
    lengths_m = [stretch.length_m for stretch in stretches]
    mean_m = sum(PANES) / 2 * (sum(PANE_M) / 2 + POST_M)
    windows: dict[int, list[_Window]] = defaultdict(list)
    parts: list[Walls] = []
    share = WINDOWED_SHARE * max(0.0, difficulty - FROM) / (1 - FROM)
    for _ in range(round(share * sum(lengths_m) / mean_m)):
        [stretch] = rng.choices(stretches, lengths_m)
        beside = windows[stretch.number]
        window = _drawn(stretch, floor, rng)
        if window is not None and all(_are_apart(window, other) for other in beside):
            beside.append(window)
            parts += window.parts(stretch.thickness_m)
    walls = [
        whole.model_copy(update={"doors": (*whole.doors, *(w.door for w in windows[number]))})
        for number, whole in enumerate(world.walls)
    ]
    return world.model_copy(update={"walls": (*walls, *parts)})


def _drawn(stretch: _Stretch, floor: FreeFloor, rng: random.Random) -> _Window | None:
    """A random window in a wall; None if it does not fit or no floor is before it."""
    panes, pane_m = rng.randint(*PANES), rng.uniform(*PANE_M)
    half_m = _Window(stretch.spot, panes, pane_m).width_m / 2
    slack_m = stretch.length_m - 2 * (half_m + BESIDE_M)
    if slack_m < 0:
        return None
    x_m = BESIDE_M + half_m + rng.uniform(0.0, slack_m)
    if not all(stretch.is_seen(x_m + share * half_m, floor) for share in (-1.0, 0.0, 1.0)):
        return None
    return _Window(stretch.spot.moved(x_m, 0.0), panes, pane_m)


def _are_apart(window: _Window, other: _Window) -> bool:
    between_m = dist(window.spot.place, other.spot.place)
    return between_m > (window.width_m + other.width_m) / 2 + BESIDE_M


def _outer(world: World, floor: FreeFloor) -> Iterator[_Stretch]:
    for number, walls in enumerate(world.walls):
        for panel in filter(_is_high, walls.panels(world.height_m)):
            for stretch in _either_way(number, panel):
                looks_m = [stretch.length_m * share for share in LOOKS]
                if any(stretch.is_seen(x_m, floor) for x_m in looks_m) and all(
                    stretch.is_last(x_m, floor) for x_m in looks_m
                ):
                    yield stretch


def _is_high(panel: Panel) -> bool:
    """The wall reaches from the floor to above a window."""
    return panel.bottom_m == 0 and panel.top_m >= LINTEL_M + MIN_ABOVE_M and not panel.glass


def _either_way(number: int, panel: Panel) -> Iterator[_Stretch]:
    """The panel with the room on either side."""
    length_m = dist(panel.start, panel.end)
    for start, end in ((panel.start, panel.end), (panel.end, panel.start)):
        along = (end[0] - start[0]) / length_m, (end[1] - start[1]) / length_m
        yield _Stretch(number, Spot(start, along), length_m, panel.thickness_m)
