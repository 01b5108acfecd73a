"""Draws a world's floor plan as a picture."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sitl.world.format import World
from sitl.world.known import KnownArea
from sitl.world.plan import wall_surfaces

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAPER = "#fbfaf7"
WALL = "#22333b"
FURNITURE = "#9aa5ad"
START = "#3a86c8"
UNKNOWN = "#d9d5cb"
BORDER = "#c8553d"
GLASS = "#5fb3d4"


def draw_plan(world: World, path: Path, height_m: float = 1.2) -> None:
    """Write a PNG: walls at this height dark, lower ones light, starts as dots, north up.

    The unknown is shaded. Its closed border is dashed.
    """
    from companion.core.figures import own_style  # noqa: PLC0415 - slow to load, and seldom needed

    with own_style():
        _draw(world, path, height_m)


def _draw(world: World, path: Path, height_m: float) -> None:
    from companion.core.figures import Figure  # noqa: PLC0415

    figure = Figure(figsize=(8, 8), dpi=120, facecolor=PAPER, layout="constrained")
    axes = figure.add_subplot(aspect="equal", facecolor=PAPER)
    if world.known is not None:
        axes.set_facecolor(UNKNOWN)
        _lay_out(world.known, axes)
    for box in world.boxes:
        for (north_a, east_a), (north_b, east_b) in box.segments:
            axes.plot([east_a, east_b], [north_a, north_b], color=FURNITURE, linewidth=1)
    for panel in world.panels:
        if panel.top_m < height_m:
            for (north_a, east_a), (north_b, east_b) in panel.outline:
                axes.plot([east_a, east_b], [north_a, north_b], color=FURNITURE, linewidth=1)
    for (north_a, east_a), (north_b, east_b) in wall_surfaces(world, height_m):
        axes.plot([east_a, east_b], [north_a, north_b], color=WALL, linewidth=1.8)
    for panel in world.panels:
        if panel.glass and panel.bottom_m <= height_m <= panel.top_m:
            (north_a, east_a), (north_b, east_b) = panel.start, panel.end
            axes.plot([east_a, east_b], [north_a, north_b], color=GLASS, linewidth=1.2)
    for (north_a, east_a), (north_b, east_b) in world.closed_border:
        axes.plot([east_a, east_b], [north_a, north_b], color=BORDER, linewidth=1.2, dashes=(3, 2))
    for start in world.starts:
        north, east = start.position
        axes.plot(east, north, marker="o", color=START)
        axes.annotate(
            start.name,
            (east, north),
            (6, 6),
            textcoords="offset points",
            color=START,
            parse_math=False,
        )
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.set_title(
        f"{world.name}, walls at {height_m:g} m of {world.height_m:g} m", parse_math=False
    )
    figure.savefig(path, format="png")


def _lay_out(known: KnownArea, axes: "Axes") -> None:
    """Draw the known cells, rotated like the map."""
    from matplotlib.colors import to_rgb  # noqa: PLC0415
    from matplotlib.transforms import Affine2D  # noqa: PLC0415

    is_known = known.free | known.occupied
    colours = np.empty((*is_known.shape, 4))
    colours[..., :3] = to_rgb(PAPER)
    colours[..., 3] = is_known
    raster = known.raster
    (column, row), (rows, columns) = raster.first, is_known.shape
    x_m, y_m, yaw_rad = raster.origin
    turned = Affine2D().scale(raster.cell_m).rotate(yaw_rad).translate(x_m, y_m)
    axes.imshow(
        colours,
        extent=(column, column + columns, row, row + rows),
        origin="lower",
        interpolation="nearest",
        transform=turned + axes.transData,
    )
    corners = raster.to_plan(np.array([(0, 0), (columns, 0), (0, rows), (columns, rows)]))
    (south, west), (north, east) = corners.min(axis=0), corners.max(axis=0)
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
