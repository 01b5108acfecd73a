"""Draws the floor plan as a PNG image."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from companion.core.messages import FloorPlan

if TYPE_CHECKING:
    from companion.core.figures import Axes

PAPER = "#fbfaf7"
WALL = "#22333b"
HIT = "#e07a1f"
FLIGHTS = ("#3a86c8", "#e08a1e", "#3f9c58", "#8a5fc2", "#c1121f", "#1aa5a5", "#b0578d", "#7a6a3a")
"""Colours of the first flight of a joint map, or the first drone of a team, the second, ..."""


def flight_colour(number: int) -> str:
    """Colour of a flight or drone by its number, from 0."""
    return FLIGHTS[number % len(FLIGHTS)]


def draw(plan: FloorPlan, path: Path) -> None:
    """Write a PNG of walls with lengths, hits, path and scale bar; east is right, north is up.

    Each flight of a joint map has a path of its own.
    """
    from companion.core.figures import Figure  # noqa: PLC0415 - slow to load, and only needed at the end

    figure = Figure(figsize=(8, 8), dpi=120, facecolor=PAPER, layout="constrained")
    axes = figure.add_subplot(aspect="equal", facecolor=PAPER)
    axes.set_axis_off()
    axes.scatter(
        [hit.position_ned_m[1] for hit in plan.hits],
        [hit.position_ned_m[0] for hit in plan.hits],
        s=3,
        color=HIT,
        alpha=0.35,
        linewidths=0,
        label="range returns",
    )
    for number, path_flown in enumerate(plan.paths):
        axes.plot(
            [pose.east_m for pose in path_flown],
            [pose.north_m for pose in path_flown],
            color=flight_colour(number),
            linewidth=1.2,
            label="path flown" if len(plan.paths) == 1 else f"flight {number + 1}",
        )
    for number, wall in enumerate(plan.walls):
        (north_a, east_a), (north_b, east_b) = wall.start_ne_m, wall.end_ne_m
        axes.plot(
            [east_a, east_b],
            [north_a, north_b],
            color=WALL,
            linewidth=3,
            solid_capstyle="round",
            label="walls" if number == 0 else None,
        )
        angle_deg = math.degrees(math.atan2(north_b - north_a, east_b - east_a))
        axes.annotate(
            f"{wall.length_m:.2f} m",
            ((east_a + east_b) / 2, (north_a + north_b) / 2),
            rotation=(angle_deg + 90) % 180 - 90,
            textcoords="offset points",
            xytext=(9 * math.sin(math.radians(angle_deg)), -9 * math.cos(math.radians(angle_deg))),
            ha="center",
            va="center",
            fontsize=9,
            color=WALL,
        )
    if plan.path:
        axes.plot(0, 0, marker="o", color=FLIGHTS[0], markersize=7, label="take-off")
    _scale_bar(axes)
    if plan.path or plan.walls:
        figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    figure.savefig(path, format="png")


def _scale_bar(axes: "Axes") -> None:
    west, east = axes.get_xlim()
    south, north = axes.get_ylim()
    bar_m = 10 ** math.floor(math.log10(max(east - west, 1e-3) / 2))
    base = south - 0.06 * (north - south)
    axes.plot([west, west + bar_m], [base, base], color=WALL, linewidth=2)
    axes.annotate(
        f"{bar_m:g} m", (west + bar_m / 2, base), (0, -12), textcoords="offset points", ha="center"
    )
