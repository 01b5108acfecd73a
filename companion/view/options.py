"""Defines the options of the commands that serve a page, opens it, and handles Ctrl-C."""

import os
import signal
import sys
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

Host = Annotated[str, typer.Option(help="Address of the page; any but 127.0.0.1 needs a token.")]
Port = Annotated[
    int, typer.Option(help="TCP port of the page; 0 selects a free port.", min=0, max=65535)
]
TokenFile = Annotated[Path | None, typer.Option(help="File with the token that the page requires.")]
OpenBrowser = Annotated[
    bool, typer.Option("--browser/--no-browser", help="Open the page in this machine's browser.")
]
PAGE_PORT = 8080
"""Default TCP port of the page. Chosen."""
LEAVE_S = 8.0
"""Longest shutdown while a browser does not respond, s. Chosen: there is no data to save."""


def open_in_browser(address: str) -> None:
    """Open the page in this machine's browser, if the machine has a screen."""
    has_screen = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if has_screen:  # without one, a text browser would take the terminal
        webbrowser.open(address)


def until_interrupted() -> Callable[[], bool]:
    """Handle SIGINT and SIGTERM; the function returned is True once one has arrived."""
    is_over = threading.Event()

    def end(number: int, frame: object) -> None:
        is_over.set()
        leave = threading.Timer(LEAVE_S, os._exit, (0,))
        leave.daemon = True
        leave.start()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    return is_over.is_set
