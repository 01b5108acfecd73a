"""Bar charts and map pictures in the layout of the paper's figures 7 to 13."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from benchmarks.paper.scenarios import ROOMS, TIME, Variant, mean
from companion.core.figures import Axes, Figure, LineCollection
from companion.core.messages import FloorPlan
from sitl.bench.missions import Sketch
from sitl.campaign.scores import Row

INK, GRID = "#22313a", "#d5dce0"
BARS = "#3a86c8", "#e08a1e"
TRUTH, MAPPED, PATHS = "#9aa5ab", "#2a9d4b", ("#3a86c8", "#d1495b")
SOLID = 0.16, 0.62, 0.29, 0.35
"""Colour of walls in three dimensions: red, green, blue, opacity."""
DPI = 110

Rows = dict[tuple[str, str], list[Row]]


def bar_chart(rows: Rows, variants: Sequence[Variant], title: str, path: Path) -> None:
    """Mean time of each room and variant, with its standard deviation."""
    figure = Figure((6.4, 4), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    width = 0.8 / len(variants)
    for number, variant in enumerate(variants):
        places = np.arange(len(ROOMS)) + (number - (len(variants) - 1) / 2) * width
        times_s = [
            [float(row[TIME]) for row in rows[room, variant.name] if row["completed"]]
            for room in ROOMS
        ]
        means = [mean(rows[room, variant.name], TIME).mean for room in ROOMS]
        bars = axes.bar(
            places,
            means,
            0.92 * width,
            yerr=[float(np.std(each)) for each in times_s],
            capsize=3,
            color=BARS[number],
            ecolor=INK,
            label=variant.name,
        )
        axes.bar_label(bars, [f"{each:.0f} s" for each in means], padding=3, color=INK)
    axes.set_xticks(np.arange(len(ROOMS)), list(ROOMS.values()))
    axes.set_ylabel("time of one round, s")
    axes.set_title(title, color=INK)
    axes.grid(axis="y", color=GRID)
    axes.set_axisbelow(True)
    axes.margins(y=0.15)
    if len(variants) > 1:
        axes.legend(frameon=False)
    figure.savefig(path, format="png")


def room_pictures(sketches: Sequence[tuple[str, Sketch]], title: str, path: Path) -> None:
    """For each room the true walls and paths on the left, and the map on the right."""
    figure = Figure((7, 3 * len(sketches)), dpi=DPI, layout="constrained")
    figure.suptitle(title, color=INK)
    panels = figure.subplots(len(sketches), 2, squeeze=False)
    for (name, sketch), (left, right) in zip(sketches, panels, strict=True):
        _lines(left, sketch.truth, TRUTH)
        for number, flown in enumerate(sketch.paths):
            _lines(left, [flown], PATHS[number % len(PATHS)])
        _lines(right, sketch.mapped, MAPPED)
        left.set_title(f"{name}: room and path", fontsize=9)
        right.set_title("scanned", fontsize=9)
        for axes in (left, right):
            axes.set_aspect("equal")
            axes.autoscale_view()
            axes.set_axis_off()
        right.set_xlim(left.get_xlim())
        right.set_ylim(left.get_ylim())
    figure.savefig(path, format="png")


def _lines(axes: Axes, lines: Sequence[Sequence[tuple[float, float]]], colour: str) -> None:
    flat = [[(east, north) for north, east in line] for line in lines]
    axes.add_collection(LineCollection(flat, colors=colour, linewidths=1.6))


def solid_picture(plans: Sequence[tuple[str, FloorPlan]], path: Path) -> None:
    """The walls of four buildings in three dimensions, seen from above and aside."""
    figure = Figure((10, 8), dpi=DPI, layout="constrained")
    for number, (name, plan) in enumerate(plans, 1):
        axes = figure.add_subplot(2, 2, number, projection="3d")
        height_m = plan.ceiling_m or 0.0
        walls = [
            [(e0, n0, 0.0), (e1, n1, 0.0), (e1, n1, height_m), (e0, n0, height_m)]
            for (n0, e0), (n1, e1) in ((wall.start_ne_m, wall.end_ne_m) for wall in plan.walls)
        ]
        axes.add_collection3d(
            Poly3DCollection(
                walls, facecolor=(0.16, 0.62, 0.29, 0.35), edgecolor=INK, linewidth=0.6
            )
        )
        corners = np.array([corner for wall in walls for corner in wall])
        axes.auto_scale_xyz(*corners.T)
        axes.set_aspect("equal")
        axes.view_init(elev=42, azim=-60)
        axes.set_axis_off()
        axes.set_title(name, color=INK)
    figure.savefig(path, format="png")
