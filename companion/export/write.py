"""Writes the map as one file in the format of the file name's suffix."""

from pathlib import Path

from companion.core.extras import needs_extra
from companion.core.frames import Place
from companion.core.messages import FloorPlan
from companion.export.map_files import save_as, save_json
from companion.export.map_png import draw

FORMATS = ("png", "json", "dxf", "svg", "pdf", "ifc", "pgm", "ply", "pcd", "glb", "bt", "geojson")
"""Known suffixes of file names, without the dot."""


def write(plan: FloorPlan, path: Path, title: str, place: Place | None) -> None:
    """Write PNG and JSON like `companion fly`, every other format like `companion export`.

    Raises:
        ValueError: the format is unknown.
        MissingExtraError: the library for this format is not installed.
        OutputError: the file cannot be written, or GeoJSON has no place.
    """
    name = path.suffix.removeprefix(".")
    match name:
        case "png":
            save_as(draw, plan, path)
        case "json":
            save_as(save_json, plan, path)
        case _ if name in FORMATS:
            with needs_extra("export"):
                from companion.export.formats import export  # noqa: PLC0415
                from companion.export.plan.labels import Labels  # noqa: PLC0415
                from companion.export.plan.survey import survey  # noqa: PLC0415

                export(survey(plan), [name], path.parent, path.stem, Labels(title, place))
        case _:
            raise ValueError(f"{path}: no format {name!r}; known: {', '.join(FORMATS)}")
