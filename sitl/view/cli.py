"""`sitl view`: serves a web page until Ctrl-C."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from companion.core.extras import needs_extra
from companion.view.options import (
    PAGE_PORT,
    Host,
    OpenBrowser,
    Port,
    TokenFile,
    open_in_browser,
    until_interrupted,
)

TITLE = "PDPS simulator"


def view(
    what: Annotated[
        str, typer.Argument(metavar="[WORLD | FLIGHT.mcap]", help="World to fly in, or recording.")
    ] = "room_100",
    host: Host = "127.0.0.1",
    port: Port = PAGE_PORT,
    token_file: TokenFile = None,
    browser: OpenBrowser = True,
) -> None:
    """Fly on a web page, or play back a recording. Ctrl-C ends it."""
    with needs_extra("viewer"):
        from companion.view.access.server import open_page  # noqa: PLC0415 - an extra
        from companion.view.playback import RECORDING_SUFFIX, Playback  # noqa: PLC0415
        from sitl.view.page import Page  # noqa: PLC0415

    is_over = until_interrupted()
    server, address = open_page(host, port, token_file, TITLE)
    with tempfile.TemporaryDirectory(prefix="pdps-page-") as folder:
        uploads = Path(folder)
        while True:
            is_recording = what.endswith(RECORDING_SUFFIX)
            page = (
                Playback(server, Path(what), uploads)
                if is_recording
                else Page(server, what, uploads)
            )
            if address:
                print(f"open     {address}", flush=True)
                if browser:
                    open_in_browser(address)
            try:
                page.run(is_over)
            finally:
                page.close()
            if page.instead is None:
                return
            # another page at the same address: browsers connect to it by themselves
            what, port, address = str(page.instead), server.get_port(), ""
            server, _ = open_page(host, port, token_file, TITLE)
