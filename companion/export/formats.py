"""Lists the export formats and calls the writer of each."""

from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from companion.core.errors import CompanionError, OutputError
from companion.core.extras import needs_extra
from companion.export.map_files import each_by_itself
from companion.export.plan.labels import Labels
from companion.export.plan.survey import Survey

WRITERS = {
    "dxf": ("dxf.write", "write_dxf"),
    "svg": ("plan.sheet", "write_svg"),
    "pdf": ("plan.sheet", "write_pdf"),
    "ifc": ("ifc.write", "write_ifc"),
    "pgm": ("ros_map", "write_ros_map"),
    "ply": ("points", "write_ply"),
    "pcd": ("points", "write_pcd"),
    "glb": ("mesh", "write_glb"),
    "bt": ("octree", "write_bt"),
    "geojson": ("geojson", "write_geojson"),
    "json": ("map_record", "write_json"),
}
"""Module of this package and function of each format; a module loads only when it is needed."""


def export(
    survey: Survey,
    formats: Sequence[str],
    folder: Path,
    stem: str,
    labels: Labels,
    *,
    tell: Callable[[Path], object] = lambda path: None,
) -> list[Path]:
    """Write the map in each format as `stem`.format and return the paths.

    A format that fails does not stop the others. `tell` is called with each path written.

    Raises:
        OutputError: at least one file cannot be written; the message names every such file.
    """
    paths = [folder / f"{stem}.{name}" for name in formats]

    def write(path: Path, name: str) -> None:
        _write(survey, path, name, labels)
        tell(path)

    each_by_itself(partial(write, *both) for both in zip(paths, formats, strict=True))
    return paths


def _write(survey: Survey, path: Path, name: str, labels: Labels) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with needs_extra("export"):
            _writer(name, labels)(survey, path)
    except CompanionError:
        raise
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error
    except Exception as error:  # a library may raise anything; the next format may work
        raise OutputError(f"{path}: {error!r}") from error


def _writer(name: str, labels: Labels) -> Callable[[Survey, Path], None]:
    module, function = WRITERS[name]
    write: Any = getattr(import_module(f"companion.export.{module}"), function)
    match name:
        case "dxf" | "svg" | "pdf" | "ifc":
            return partial(write, labels=labels)
        case "geojson":
            return partial(write, place=labels.place)
        case _:
            return partial(write)
