"""Options of the commands that serve a page, and their waiting for Ctrl-C."""

import os
import signal
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

Host = Annotated[
    str, typer.Option(help="Address to serve the page at; others than 127.0.0.1 need a token.")
]
Port = Annotated[int, typer.Option(help="TCP port of the page; 0: any.", min=0, max=65535)]
TokenFile = Annotated[
    Path | None, typer.Option(help="File with the token that the page's address must have.")
]
PAGE_PORT = 8080
LEAVE_S = 8.0
"""A browser that does not answer keeps the program no longer than this; nothing is to be saved."""


def until_interrupted() -> Callable[[], bool]:
    """Whether Ctrl-C was pressed, or the program was told to end."""
    is_over = threading.Event()

    def end(number: int, frame: object) -> None:
        is_over.set()
        leave = threading.Timer(LEAVE_S, os._exit, (0,))
        leave.daemon = True
        leave.start()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    return is_over.is_set
