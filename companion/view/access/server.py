"""Starts viser's server with `Guard` in front of it."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rich
import viser
from websockets.asyncio import server as websocket_server

from companion.core.errors import ViewError
from companion.core.secret import is_loopback, needs_token, read_token
from companion.view.access.branding import branded
from companion.view.access.guard import Guard

BRAND = (42, 157, 143)
"""Colour of the page's theme, RGB, 0 to 255. Chosen."""


class PageServer(viser.ViserServer):
    """Viser's server without the public tunnel that viser offers."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Return None: any client could otherwise publish the page with one click."""
        return None


def open_page(host: str, port: int, token_file: Path | None, title: str) -> tuple[PageServer, str]:
    """Serve an empty page and return its server and address; port 0 selects a free port.

    Raises:
        ViewError: other machines can reach the address and there is no token, or the port is in
            use.
    """
    if token_file is None and not is_loopback(host):
        raise ViewError(needs_token("--host", host, "--token-file"))
    token = read_token(token_file, "--token-file") if token_file else None
    listener = _listen(host, port)
    port = listener.getsockname()[1]
    rich.get_console().quiet = True  # viser prints to this console
    with _guarding(Guard(token, port), listener, title) as is_guarded:
        server = PageServer("127.0.0.1", 0, label=title, verbose=False)
    if not is_guarded:
        server.stop()
        raise ViewError(
            "this version of viser does not support the access check: pip install 'viser<1.2'"
        )
    server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BRAND)
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_grid(
        "/grid",
        infinite_grid=True,
        cell_size=1.0,
        section_size=5.0,
        cell_color=(226, 230, 233),
        section_color=(200, 206, 210),
        shadow_opacity=0.0,
        position=(0.0, 0.0, -0.01),
    )
    shown = f"[{host}]" if ":" in host else host
    return server, f"http://{shown}:{port}/" + (f"?token={token}" if token else "")


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        return socket.create_server((host, port), family=family)
    except OSError as error:
        is_named = error.errno is not None and error.errno > 0
        reason = os.strerror(error.errno) if is_named else error.strerror  # type: ignore[arg-type]
        raise ViewError(f"--host {host} --port {port}: {reason}; choose another") from error


@contextmanager
def _guarding(guard: Guard, listener: socket.socket, title: str) -> Iterator[list[bool]]:
    """Pass our listener, guard and title to the server that viser starts.

    The list yielded is not empty once viser has used them.
    """
    serve = websocket_server.serve
    is_guarded: list[bool] = []

    def guarded(
        handler: Any, host: str, port: int, *, process_request: Any, **options: Any
    ) -> websocket_server.serve:
        is_guarded.append(True)
        asked_first = guard.before(branded(process_request, title))
        return serve(handler, sock=listener, process_request=asked_first, **options)

    websocket_server.serve = guarded  # type: ignore[assignment, misc]
    try:
        yield is_guarded
    finally:
        websocket_server.serve = serve  # type: ignore[misc]
