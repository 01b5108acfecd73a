"""Writes a world in its text format, so that a random one can be kept and edited."""

from pathlib import Path

import tomlkit

from sitl.world.format import Walls, World, WorldError


def to_toml(world: World) -> str:
    """Text that `parse_world` reads as the same world. A closed border becomes ordinary walls.

    Raises:
        WorldError: the world is a mesh.
    """
    if world.mesh is not None:
        raise WorldError(f"{world.name}: a mesh cannot be written as text")
    border = tuple(Walls(points=segment) for segment in world.closed_border)
    plain = world.model_copy(update={"walls": (*world.walls, *border), "known": None})
    kept = plain.model_dump(mode="json", exclude={"mesh", "known"}, exclude_defaults=True)
    return tomlkit.dumps(kept)


def write_world(world: World, path: Path) -> None:
    """Write a world as a UTF-8 file."""
    path.write_text(to_toml(world), encoding="utf-8")
