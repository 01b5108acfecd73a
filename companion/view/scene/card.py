"""Shows a card when a flight has ended: the plan, the numbers, and the map to download."""

import base64
import html
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from viser import GuiApi, GuiHtmlHandle, PanelHandle

from companion.core.messages import FloorPlan
from companion.export.map_png import draw
from companion.export.write import FORMATS
from companion.view.access.act_queue import Event

WIDTH_PX, AWAY_PX = 430, 12
"""Width of the card, and its distance from the edges of the scene, pixels. Chosen: beside it the
map of a window of 1280 pixels stays in view."""
PICTURE_PX = 150
"""Side of the picture of the plan, pixels. Chosen."""


class Card:
    """The card, which a page shows after a flight and removes before the next."""

    def __init__(self, gui: GuiApi, send: Callable[[Event, str], None]) -> None:
        """`send`: sends the map in a format to the client of the event."""
        self._gui = gui
        self._send = send
        self._panel: PanelHandle | None = None
        self._content: GuiHtmlHandle | None = None
        self._picture = ""

    def show(self, picture: bytes, rows: Mapping[str, str]) -> None:
        """Show the card with a picture of `picture_of` and these numbers."""
        self.hide()
        self._picture = base64.b64encode(picture).decode()
        self._panel = self._gui.add_panel()
        with self._panel.add_tab("Result"):
            self._content = self._gui.add_html(self._html(rows))
            formats = self._gui.add_button_group("download", FORMATS, hint="The map in a format")
        formats.on_click(lambda event: self._send(event, formats.value))
        self._panel.float(x=AWAY_PX, y=-AWAY_PX, width=WIDTH_PX)
        self._panel.expand()  # also on a phone

    def tell(self, rows: Mapping[str, str]) -> None:
        """Show other numbers."""
        if self._content is not None:
            self._content.content = self._html(rows)

    def hide(self) -> None:
        if self._panel is not None:
            self._panel.remove()
            self._panel = self._content = None

    def _html(self, rows: Mapping[str, str]) -> str:
        cells = "".join(
            f'<tr><td style="opacity:.65;padding-right:.8em">{html.escape(key)}</td>'
            f"<td><b>{html.escape(text)}</b></td></tr>"
            for key, text in rows.items()
        )
        picture = (
            f'<img alt="plan" style="width:{PICTURE_PX}px;max-width:45%;object-fit:contain" '
            f'src="data:image/png;base64,{self._picture}"/>'
        )
        style = "font-size:.8em;line-height:1.25;border-spacing:0"
        table = f'<table class="pdps-result" style="{style}">{cells}</table>'
        style = "display:flex;flex-wrap:wrap;gap:1em;margin:.4em .8em"
        return f'<div style="{style}">{picture}<div>{table}</div></div>'


def picture_of(plan: FloorPlan) -> bytes:
    """The plan as a PNG; drawing it takes about a second."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.png"
        draw(plan, path)
        return path.read_bytes()
