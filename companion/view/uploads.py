"""Receives a file from the browser, by a button, or dropped anywhere on the page."""

from collections.abc import Callable
from pathlib import Path

from viser import GuiApi, GuiEvent, GuiUploadButtonHandle

from companion.view.access.act_queue import ActQueue


class Uploads:
    """The button; each file is stored in a folder."""

    def __init__(
        self, gui: GuiApi, turns: ActQueue, folder: Path, hint: str, take: Callable[[Path], None]
    ) -> None:
        """`take`: is called with each file in the thread of `turns`; its errors are shown."""
        self._turns = turns
        self._folder = folder
        self._take = take
        self._button = gui.add_upload_button("Open a file, or drop it here", hint=hint)
        self._button.on_upload(self._receive)

    def _receive(self, event: GuiEvent[GuiUploadButtonHandle]) -> None:
        file = self._button.value
        # only the last part of the name, so that the file stays in the folder
        path = self._folder / (Path(file.name.replace("\\", "/")).name or "file")
        path.write_bytes(file.content)
        self._turns.pressed(lambda: self._named(path))(event)

    def _named(self, path: Path) -> None:
        """Take a file; errors name it as the user does."""
        try:
            self._take(path)
        except self._turns.refusals as error:
            raise type(error)(str(error).replace(str(path), path.name)) from error
