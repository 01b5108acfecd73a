"""Loads a world by its name or from a file."""

from collections.abc import Callable
from importlib import resources
from pathlib import Path

from companion.core.textfile import NotTextError, read_text, reason
from sitl.world.format import World, WorldError, parse_world
from sitl.world.generator import named


def load_segments(path: Path, report: Callable[[str], None]) -> World:
    """Load a plan as wall segments. Importers are imported only here: they take half a second."""
    from sitl.world.importers import segments  # noqa: PLC0415 - slow to load

    return segments.load_segments(path, report)


def load_ros_map(path: Path, report: Callable[[str], None]) -> World:
    """Load a ROS map."""
    from sitl.world.importers import ros_map  # noqa: PLC0415 - slow to load

    return ros_map.load_ros_map(path, report)


def load_mesh(path: Path, report: Callable[[str], None]) -> World:
    """Load a mesh."""
    from sitl.world.importers import meshes  # noqa: PLC0415 - slow to load

    return meshes.load_mesh(path, report)


IMPORTERS: dict[str, Callable[[Path, Callable[[str], None]], World]] = {
    ".json": load_segments,
    **dict.fromkeys((".yaml", ".yml"), load_ros_map),
    **dict.fromkeys((".stl", ".obj", ".ply", ".glb", ".gltf"), load_mesh),
}
"""Importers by the file's suffix in lower case."""

RANDOM = "random_SEED or random_large_SEED such as random_17"
"""Patterns of the names of random buildings, for messages."""


def world_names() -> list[str]:
    """Names of the built-in worlds."""
    rooms = resources.files("sitl.world") / "rooms"
    return sorted(p.name.removesuffix(".toml") for p in rooms.iterdir() if p.name.endswith(".toml"))


def discard_report(repair: str) -> None:
    """Discard an importer's messages."""


def load_world(name_or_path: str, report: Callable[[str], None] = discard_report) -> World:
    """Load a built-in or random world by name, or a world file; `report` receives repairs.

    Raises:
        WorldError: the world is unknown, or its file cannot be read or is invalid.
    """
    if name_or_path in world_names():
        room = resources.files("sitl.world") / "rooms" / f"{name_or_path}.toml"
        return parse_world(room.read_text(encoding="utf-8"), name_or_path)
    if building := named(name_or_path):
        return building
    path = Path(name_or_path)
    suffix = path.suffix.lower()
    if suffix == ".toml":
        try:
            return parse_world(read_text(path), name_or_path)
        except (OSError, NotTextError) as error:
            raise WorldError(f"{name_or_path}: {reason(error)}") from error
    if suffix in IMPORTERS:
        return IMPORTERS[suffix](path, report)
    known, suffixes = ", ".join(world_names()), ", ".join([".toml", *IMPORTERS])
    raise WorldError(
        f"no world {name_or_path!r}; known: {known}, {RANDOM}, or a file ending in {suffixes}"
    )
