"""The commands `sitl world`: list, show, check and export worlds."""

import re
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.export.map_files import save_as
from sitl.world.checking import extent, facts, warnings
from sitl.world.cleaning import cleaned
from sitl.world.clutter import cluttered
from sitl.world.format import World
from sitl.world.geometry.mesh import visible_mesh
from sitl.world.loading import RANDOM, load_world, world_names
from sitl.world.writing import write_world

MAX_LETTERS = 50
"""Longest name of a default file, letters of up to 4 bytes; file systems allow 255 bytes."""
WORLD_HELP = "A built-in world, random_SEED, or a world file."
Clutter = Annotated[
    float,
    typer.Option(help="Furniture, curtains and open doors: 0 none, 1 maximum.", min=0, max=1),
]
Clean = Annotated[
    bool,
    typer.Option("--clean", help="Leave out specks, join dotted lines, smooth curtains."),
]
ClutterSeed = Annotated[int, typer.Option(help="Seed of the clutter.")]

commands = typer.Typer(no_args_is_help=True, help="List, draw, check and export worlds.")


@commands.command("list")
def list_worlds() -> None:
    """List the built-in worlds and the pattern of random ones."""
    table = Table("world", "extent", "ceiling", "starts", "triangles")
    for name in world_names():
        world = load_world(name)
        north_m, east_m = extent(world)
        table.add_row(
            name,
            f"{north_m:g} × {east_m:g} m",
            f"{world.height_m:g} m",
            ", ".join(start.name for start in world.starts),
            str(len(visible_mesh(world).faces)),
        )
    Console().print(table)
    typer.echo(f"and {RANDOM}: a random building, the same for the same seed")


@commands.command()
def show(
    world: Annotated[str, typer.Argument(help=WORLD_HELP)],
    clean: Clean = False,
    clutter: Clutter = 0.0,
    clutter_seed: ClutterSeed = 1,
    out: Annotated[Path | None, typer.Option(help="PNG to write; default NAME.png.")] = None,
) -> None:
    """Draw the floor plan with its start poses."""
    from sitl.world.drawing import draw_plan  # noqa: PLC0415 - slow to load, and seldom needed

    loaded = _loaded(world, clutter, clutter_seed, clean=clean)
    path = out or _named(loaded, ".png")
    save_as(draw_plan, loaded, path)
    typer.echo(str(path))


@commands.command()
def check(
    world: Annotated[str, typer.Argument(help=WORLD_HELP)],
    clean: Clean = False,
    clutter: Clutter = 0.0,
    clutter_seed: ClutterSeed = 1,
) -> None:
    """Load a world; print the importer's repairs, the known area, the starts and warnings."""
    loaded = _loaded(world, clutter, clutter_seed, clean=clean)
    for fact in facts(loaded):
        typer.echo(fact)
    beware = warnings(loaded)
    for warning in beware:
        typer.echo(f"warning: {warning}")
    parts = f"{len(loaded.panels)} walls, {len(loaded.boxes)} boxes"
    if loaded.mesh is not None:
        parts = f"{len(loaded.mesh.faces)} triangles"
    verdict = "see the warnings" if beware else "good"
    typer.echo(f"{loaded.name}: {parts}, {len(loaded.starts)} starts, {verdict}")


@commands.command()
def export(
    world: Annotated[str, typer.Argument(help=WORLD_HELP)],
    clean: Clean = False,
    clutter: Clutter = 0.0,
    clutter_seed: ClutterSeed = 1,
    out: Annotated[Path | None, typer.Option(help="File to write; default NAME.toml.")] = None,
) -> None:
    """Write a world with its clutter as TOML, to reuse or edit it."""
    loaded = _loaded(world, clutter, clutter_seed, clean=clean)
    if loaded.closed_border:
        typer.echo("the closed border is written as walls, which the scores will count")
    path = out or _named(loaded, ".toml")
    save_as(write_world, loaded, path)
    typer.echo(str(path))


def _named(world: World, suffix: str) -> Path:
    """A file in this folder, named after the world; its name may have letters that files lack."""
    name = re.sub(r"[^\w .+-]", "_", world.name)[:MAX_LETTERS].strip(" .")
    return Path(f"{name or 'world'}{suffix}")


def _loaded(name: str, clutter: float, clutter_seed: int, *, clean: bool) -> World:
    """The world, cleaned and then with clutter; prints what was repaired and cleaned."""
    loaded = load_world(name, typer.echo)
    if clean:
        loaded = cleaned(loaded, typer.echo)
    return cluttered(loaded, clutter, clutter_seed)
