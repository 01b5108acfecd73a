"""A world's plan as a picture, for people who choose or write one."""

from pathlib import Path

from sitl.world.format import World
from sitl.world.plan import wall_surfaces

PAPER = "#fbfaf7"
WALL = "#22333b"
FURNITURE = "#9aa5ad"
START = "#3a86c8"


def draw_plan(world: World, path: Path, height_m: float = 1.2) -> None:
    """PNG: what stands at a height dark, the rest of the boxes light, starts as dots; north up."""
    from companion.figures import Figure  # noqa: PLC0415 - slow to load, and seldom needed

    figure = Figure(figsize=(8, 8), dpi=120, facecolor=PAPER, layout="constrained")
    axes = figure.add_subplot(aspect="equal", facecolor=PAPER)
    for box in world.boxes:
        for (north_a, east_a), (north_b, east_b) in box.segments:
            axes.plot([east_a, east_b], [north_a, north_b], color=FURNITURE, linewidth=1)
    for (north_a, east_a), (north_b, east_b) in wall_surfaces(world, height_m):
        axes.plot([east_a, east_b], [north_a, north_b], color=WALL, linewidth=1.8)
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
