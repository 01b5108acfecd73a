"""Which formats there are, and the writer of each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from companion.errors import OutputError
from companion.export.survey import Survey
from companion.frames import Place

WRITERS = {
    "dxf": ("dxf", "write_dxf"),
    "svg": ("sheet", "write_svg"),
    "pdf": ("sheet", "write_pdf"),
    "pgm": ("ros_map", "write_ros_map"),
    "ply": ("points", "write_ply"),
    "pcd": ("points", "write_pcd"),
    "glb": ("mesh", "write_glb"),
    "bt": ("octree", "write_bt"),
    "geojson": ("geojson", "write_geojson"),
    "json": ("records", "write_json"),
}
"""Module of this package and function, for each format; only what is asked for is loaded."""


@dataclass(frozen=True, slots=True)
class Labels:
    """What a map does not know of itself."""

    title: str
    place: Place


def export(
    survey: Survey, formats: Sequence[str], folder: Path, stem: str, labels: Labels
) -> list[Path]:
    """Write the map in each format as `stem`.format; the paths.

    Raises:
        ModuleNotFoundError: the library that a format needs is not installed.
        OutputError: a file cannot be written.
    """
    paths = []
    for name in formats:
        path = folder / f"{stem}.{name}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _writer(name, labels)(survey, path)
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(f"{path}: {error.strerror or error}") from error
        paths.append(path)
    return paths


def _writer(name: str, labels: Labels) -> Callable[[Survey, Path], None]:
    module, function = WRITERS[name]
    write: Any = getattr(import_module(f"companion.export.{module}"), function)
    match name:
        case "svg" | "pdf":
            return partial(write, title=labels.title)
        case "geojson":
            return partial(write, place=labels.place)
        case _:
            return partial(write)
