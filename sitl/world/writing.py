"""A world in its text format, so that what chance has made can be kept and changed by hand."""

from pathlib import Path

import tomlkit

from sitl.world.format import Walls, World, WorldError


def to_toml(world: World) -> str:
    """What `parse_world` reads as the same world; a closed border becomes walls like others.

    Raises:
        WorldError: it is a mesh.
    """
    if world.mesh is not None:
        raise WorldError(f"{world.name}: a mesh cannot be written as text")
    border = tuple(Walls(points=segment) for segment in world.closed_border)
    plain = world.model_copy(update={"walls": (*world.walls, *border), "known": None})
    kept = plain.model_dump(mode="json", exclude={"mesh", "known"}, exclude_defaults=True)
    return tomlkit.dumps(kept)


def write_world(world: World, path: Path) -> None:
    """As UTF-8."""
    path.write_text(to_toml(world), encoding="utf-8")
