"""Sends the finished map to the browser as a download."""

import io
import tempfile
import zipfile
from pathlib import Path

from viser import ClientHandle

from companion.core.frames import Place
from companion.core.messages import FloorPlan
from companion.export.write import write


def send(client: ClientHandle, plan: FloorPlan, name: str, title: str, place: Place | None) -> None:
    """Send the map in one format; a format of several files is sent as a ZIP archive.

    Raises:
        MissingExtraError: the library for this format is not installed.
        OutputError: the file cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        write(plan, Path(folder) / f"map.{name}", title, place)
        files = sorted(Path(folder).iterdir())
        content = files[0].read_bytes() if len(files) == 1 else _zipped(files)
    file_name = f"map.{name}" if len(files) == 1 else f"map_{name}.zip"
    client.send_file_download(file_name, content, save_immediately=True)


def _zipped(files: list[Path]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            archive.write(file, file.name)
    return content.getvalue()
