"""Draws the map as a plan in two dimensions: walls with their lengths, the path, the drone."""

import html
import math
from collections.abc import Sequence

import numpy as np
from viser import GuiApi

from companion.core.arrays import Array
from companion.core.frames import Vector2, frd_to_ned
from companion.core.messages import Pose, Sketch, WallSegment
from companion.core.values import value
from companion.mapping.wall_lengths import TOLERANCE_SIGMAS, length_sigmas_m
from companion.view.scene.labels import unobstructed

WIDTH_PX, MAX_HEIGHT_PX = 290, 420
"""Largest size of the plan, pixels. Chosen: it fits into a panel."""
MARGIN_PX = 14
"""Free margin around the plan, pixels. Chosen."""
TEXT_PX = 10
"""Size of a text, pixels. Chosen."""
LABELLED_FROM_M = 1.0
"""Shortest wall with a length, m. Chosen."""
MIN_EXTENT_M = 4.0
"""Smallest extent of a plan, m. Chosen."""
MAX_POINTS = 400
"""Largest number of points of a drawn path. Chosen."""
STYLE = """<style>.pdps-plan line {stroke-linecap: round}
.pdps-plan .true {stroke: #c9ced2; stroke-width: 5} .pdps-plan .earlier {stroke: #8b989f}
.pdps-plan .wall {stroke: #22313b; stroke-width: 2.5} .pdps-plan polyline {fill: none}
.pdps-plan text {font: 10px sans-serif; text-anchor: middle; dominant-baseline: middle;
paint-order: stroke; stroke: #fff; stroke-width: 3px}</style>"""
Line = tuple[Vector2, Vector2]


@value
class Placed:
    """Place of the map's frame in the plan: its origin (north, east), m, and its heading."""

    origin_ne_m: Vector2 = (0.0, 0.0)
    heading_rad: float = 0.0

    def ne_m(self, point_ne_m: Vector2) -> Vector2:
        """From the map's frame to that of the plan, (north, east), m."""
        north_m, east_m = frd_to_ned(*point_ne_m, self.heading_rad)
        return self.origin_ne_m[0] + north_m, self.origin_ne_m[1] + east_m


class PlanView:
    """The plan in a panel, up to date at each call of `show`."""

    def __init__(self, gui: GuiApi) -> None:
        self._picture = gui.add_html("")

    def show(
        self,
        sketch: Sketch,
        pose: Pose | None,
        colour: str,
        placed: Placed = Placed(),  # noqa: B008 - it is frozen
        true_walls: Sequence[Line] = (),
    ) -> None:
        """Show a map with the drone in its colour, over true walls in the frame of the plan."""
        self._picture.content = plan_svg(sketch, pose, colour, placed, true_walls)


def plan_svg(
    sketch: Sketch, pose: Pose | None, colour: str, placed: Placed, true_walls: Sequence[Line]
) -> str:
    """The plan as SVG."""
    walls = [_placed(wall, placed) for wall in sketch.walls]
    earlier = [_placed(wall, placed) for wall in sketch.earlier_walls]
    stride = 1 + len(sketch.path_ned_m) // MAX_POINTS
    path = [placed.ne_m((north, east)) for north, east, _ in sketch.path_ned_m[::stride]]
    here = [] if pose is None else [placed.ne_m((pose.north_m, pose.east_m))]
    lines = [*walls, *earlier, *true_walls]
    sheet = _Sheet([*(end for line in lines for end in line), *path, *here])
    parts = [
        *(sheet.line(line, "true") for line in true_walls),
        *(sheet.line(line, "earlier") for line in earlier),
        *(sheet.line(line, "wall") for line in walls),
        sheet.path([*path, *here], colour),
        *_lengths(sheet, sketch.walls, walls),
    ]
    if pose is not None:
        parts.append(sheet.drone(here[0], pose.yaw_rad + placed.heading_rad, colour))
    return sheet.svg(parts)


def _placed(wall: WallSegment, placed: Placed) -> Line:
    return placed.ne_m(wall.start_ne_m), placed.ne_m(wall.end_ne_m)


def _lengths(sheet: "_Sheet", walls: Sequence[WallSegment], lines: Sequence[Line]) -> list[str]:
    """Lengths of walls with their tolerances; the longest come first, and none lies on another."""
    numbers = sorted(range(len(walls)), key=lambda number: -walls[number].length_m)
    numbers = [number for number in numbers if walls[number].length_m >= LABELLED_FROM_M]
    sigmas_m = length_sigmas_m(walls)
    texts = [
        f"{walls[number].length_m:.2f} ± {TOLERANCE_SIGMAS * sigmas_m[number]:.2f}"
        for number in numbers
    ]
    middles = [sheet.px(_middle(lines[number])) for number in numbers]
    half_px = [0.3 * TEXT_PX * (len(text) + 1) for text in texts]
    middles = [sheet.inside(middle, half) for middle, half in zip(middles, half_px, strict=True)]
    boxes = np.array(
        [
            (x - half, y - 0.6 * TEXT_PX, x + half, y + 0.6 * TEXT_PX)
            for (x, y), half in zip(middles, half_px, strict=True)
        ]
    ).reshape(-1, 4)
    return [
        f'<text x="{x:.1f}" y="{y:.1f}">{html.escape(text)}</text>'
        for (x, y), text, is_free in zip(middles, texts, unobstructed(boxes), strict=True)
        if is_free
    ]


def _middle(line: Line) -> Vector2:
    (north_a, east_a), (north_b, east_b) = line
    return (north_a + north_b) / 2, (east_a + east_b) / 2


class _Sheet:
    """The scale of a plan, and its parts in pixels."""

    def __init__(self, places_ne_m: Sequence[Vector2]) -> None:
        places: Array = np.array(places_ne_m or [(0.0, 0.0)], dtype=float)
        least, most = places.min(axis=0), places.max(axis=0)
        middle = (least + most) / 2
        deep_m, wide_m = np.maximum(most - least, MIN_EXTENT_M).tolist()
        self._px_per_m = min(
            (WIDTH_PX - 2 * MARGIN_PX) / wide_m, (MAX_HEIGHT_PX - 2 * MARGIN_PX) / deep_m
        )
        self._north_m, self._east_m = middle.tolist()
        self._height_px = deep_m * self._px_per_m + 2 * MARGIN_PX

    def px(self, point_ne_m: Vector2) -> Vector2:
        """Place on the sheet, x and y from the upper left corner."""
        north_m, east_m = point_ne_m
        x = WIDTH_PX / 2 + (east_m - self._east_m) * self._px_per_m
        return x, self._height_px / 2 - (north_m - self._north_m) * self._px_per_m

    def inside(self, place: Vector2, half_px: float) -> Vector2:
        """The middle of a text that is moved into the sheet."""
        x, y = place
        return min(max(x, half_px), WIDTH_PX - half_px), y

    def line(self, line: Line, kind: str) -> str:
        (x1, y1), (x2, y2) = self.px(line[0]), self.px(line[1])
        return f'<line class="{kind}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'

    def path(self, points: Sequence[Vector2], colour: str) -> str:
        places = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self.px, points))
        return f'<polyline points="{places}" stroke="{colour}"/>'

    def drone(self, place: Vector2, yaw_rad: float, colour: str) -> str:
        x, y = self.px(place)
        turn = f"translate({x:.1f} {y:.1f}) rotate({math.degrees(yaw_rad):.0f})"
        return f'<path class="drone" transform="{turn}" d="M0-7L5 6L0 3L-5 6Z" fill="{colour}"/>'

    def svg(self, parts: Sequence[str]) -> str:
        size = f'viewBox="0 0 {WIDTH_PX} {self._height_px:.0f}" width="100%"'
        return f'{STYLE}<svg class="pdps-plan" {size}>{"".join(parts)}</svg>'
