"""Draws the maps of several programs side by side, in the layout of the paper's figure 15."""

import math
from collections.abc import Sequence
from pathlib import Path

from companion.core.arrays import Array
from companion.core.figures import Figure, LineCollection
from companion.core.frames import Vector2

INK, WALLS, POINTS = "#22313a", "#d1495b", "#22313a"
DPI, COLUMNS = 110, 3
MAX_POINTS = 20_000
"""Points of a panel; more only make the picture slower to draw. Chosen."""


def map_pictures(
    walls: Sequence[tuple[Vector2, Vector2]],
    maps: Sequence[tuple[str, Array]],
    title: str,
    path: Path,
) -> None:
    """A panel for each map: the ends of its scans (n, 2), north and east, m, over the walls."""
    rows = math.ceil(len(maps) / COLUMNS)
    figure = Figure((3.2 * COLUMNS, 2.6 * rows + 0.4), dpi=DPI, layout="constrained")
    figure.suptitle(title, color=INK)
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    true = [[(east, north) for north, east in wall] for wall in walls]
    for axes in panels:
        axes.set_axis_off()
    for axes, (name, points_ne_m) in zip(panels, maps, strict=False):
        some = points_ne_m[:: max(1, len(points_ne_m) // MAX_POINTS)]
        axes.scatter(some[:, 1], some[:, 0], s=0.3, color=POINTS, linewidths=0, rasterized=True)
        axes.add_collection(LineCollection(true, colors=WALLS, linewidths=0.8))
        axes.set_aspect("equal")
        axes.set_title(name, fontsize=8)
    figure.savefig(path, format="png")
