"""The finished map as a file in the browser's downloads."""

import io
import tempfile
import zipfile
from pathlib import Path

from viser import ClientHandle

from companion.extras import needs_extra
from companion.frames import Place
from companion.mapping.files import save_json
from companion.mapping.picture import draw
from companion.messages import FloorPlan

NAMES = ("png", "json", "dxf", "svg", "pdf", "pgm", "ply", "pcd", "glb", "bt", "geojson")


def send(client: ClientHandle, plan: FloorPlan, name: str, title: str, place: Place) -> None:
    """One format; more than one file comes as a ZIP.

    Raises:
        MissingExtraError: the library that writes it is not installed.
        OutputError: it cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = _write(plan, name, Path(folder), title, place)
        content = files[0].read_bytes() if len(files) == 1 else _zipped(files)
    file_name = f"map.{name}" if len(files) == 1 else f"map_{name}.zip"
    client.send_file_download(file_name, content, save_immediately=True)


def _write(plan: FloorPlan, name: str, folder: Path, title: str, place: Place) -> list[Path]:
    path = folder / f"map.{name}"
    match name:
        case "png":
            draw(plan, path)
        case "json":
            save_json(plan, path)
        case _:
            _export(plan, name, folder, title, place)
    return sorted(folder.iterdir())


def _export(plan: FloorPlan, name: str, folder: Path, title: str, place: Place) -> None:
    with needs_extra("export"):
        from companion.export.formats import Labels, export  # noqa: PLC0415
        from companion.export.survey import survey  # noqa: PLC0415

        export(survey(plan), [name], folder, "map", Labels(title, place))


def _zipped(files: list[Path]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            archive.write(file, file.name)
    return content.getvalue()
