"""Plots of a campaign: scores by each setting that was varied, and where drones collided."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from companion.core.figures import Axes, Figure, LineCollection, own_style
from companion.export.map_files import save_as
from sitl.campaign.scores import SCORES, Mean, Row, Score, values
from sitl.campaign.summary import NOT_GROUPED, grouped
from sitl.world.loading import load_world
from sitl.world.plan import wall_surfaces

SHOWN = tuple(
    score
    for score in SCORES
    if score.key in ("wall_error_aligned_cm", "coverage", "flight_time_s", "clearance_m")
)
"""Scores with a panel in each figure; a further panel has the share of completed missions."""
BINS = 8
"""Number of groups of a setting that was drawn from a range. Chosen."""
MAX_VALUES = 24
"""Most values of a setting that are drawn one by one. Chosen."""
HEIGHT_M = 1.2
"""Height of the plan below the collisions, m: that of a mission by default."""
DPI = 110
INK, LINE, FAINT, BAD = "#22313a", "#3a86c8", "#b9c4cb", "#d1495b"


def save_plots(rows: Sequence[Row], varied: Sequence[str], folder: Path) -> list[Path]:
    """Write a PNG for each varied setting, and one for each world with collisions.

    Raises:
        OutputError: a file cannot be written.
    """
    saved = []
    for key in varied:
        groups = _groups(rows, key) if key not in NOT_GROUPED else []
        if len(groups) > 1:
            path = folder / f"by_{key.replace('.', '_')}.png"
            save_as(partial(_draw_scores, key), groups, path)
            saved.append(path)
    for world, those in grouped(rows, "world"):
        if any(row.get("hits_north_m") for row in those):
            path = folder / f"collisions_{Path(str(world)).stem}.png"
            save_as(partial(_draw_hits, world), those, path)
            saved.append(path)
    return saved


Groups = list[tuple[Any, list[Row]]]


def _groups(rows: Sequence[Row], key: str) -> Groups:
    """The rows by value; by equal parts of the range, where there are many numbers."""
    found = grouped(rows, key)
    if found and len(found) <= MAX_VALUES:
        return found
    numbers = [row for row in rows if isinstance(row.get(key), int | float)]
    if len(numbers) < len(rows):
        return []
    least, most = (pick(float(row[key]) for row in rows) for pick in (min, max))
    width = (most - least) / BINS
    parts: dict[int, list[Row]] = {}
    for row in rows:
        parts.setdefault(min(int((float(row[key]) - least) / width), BINS - 1), []).append(row)
    return [(least + (number + 0.5) * width, parts[number]) for number in sorted(parts)]


@own_style()
def _draw_scores(key: str, groups: Groups, path: Path) -> None:
    """Panels of scores: means with 95 % intervals."""
    figure = Figure((11, 6), dpi=DPI, layout="constrained")
    panels = figure.subplots(2, 3).ravel()
    done = Score("completed", "missions completed, %", "{:.0f}", 100.0)
    for axes, score in zip(panels, (*SHOWN, done), strict=False):
        _panel(axes, groups, score)
        axes.set_xlabel(key)
    panels[-1].set_axis_off()
    total = sum(len(rows) for _, rows in groups)
    panels[-1].text(0, 0.9, f"{total} flights\nmeans, 95 % intervals", color=INK, va="top")
    figure.savefig(path, format="png")


def _panel(axes: Axes, groups: Groups, score: Score) -> None:
    means = [(value, Mean.of(values(rows, score))) for value, rows in groups]
    means = [(value, mean) for value, mean in means if mean.number]
    are_numbers = all(isinstance(value, int | float) for value, _ in means)
    places = [value if are_numbers else number for number, (value, _) in enumerate(means)]
    halves = [mean.half or 0.0 for _, mean in means]
    axes.errorbar(
        places,
        [mean.mean for _, mean in means],
        yerr=halves,
        color=LINE,
        marker="o",
        capsize=3,
        linestyle="-" if are_numbers else "",
    )
    if not are_numbers:
        names = [Path(str(value)).stem if value is not None else "default" for value, _ in means]
        axes.set_xticks(places, names, rotation=60 if len(names) > 4 else 0, fontsize=7)
    axes.set_title(score.title, fontsize=10, color=INK)
    axes.grid(color=FAINT, linewidth=0.5)


@own_style()
def _draw_hits(world: str, rows: Sequence[Row], path: Path) -> None:
    """The plan with a cross for each collision."""
    figure = Figure((7, 7), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    surfaces = wall_surfaces(load_world(world), HEIGHT_M)
    lines = [[(east, north) for north, east in surface] for surface in surfaces]
    axes.add_collection(LineCollection(lines, colors=FAINT, linewidths=1.2))
    east_m = [place for row in rows for place in row.get("hits_east_m") or ()]
    north_m = [place for row in rows for place in row.get("hits_north_m") or ()]
    axes.plot(east_m, north_m, "x", color=BAD, markersize=7)
    axes.set_aspect("equal")
    axes.autoscale_view()
    name = Path(str(world)).stem
    axes.set_title(f"{name}: {len(east_m)} collisions in {len(rows)} flights", color=INK)
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    figure.savefig(path, format="png")
