"""Serves a page with the live map until Ctrl-C: `companion view`."""

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

commands = typer.Typer()


@commands.command("view")
def view(
    drone: Annotated[
        str,
        typer.Argument(
            metavar="HOST[:PORT]", help="Address in the drone's view.listen; see docs/viewer.md."
        ),
    ],
    drone_token_file: Annotated[
        Path | None, typer.Option(help="File with the same token as the drone's view.token_file.")
    ] = None,
    host: Host = "127.0.0.1",
    port: Port = PAGE_PORT,
    token_file: TokenFile = None,
    browser: OpenBrowser = True,
) -> None:
    """Show a flying drone's map on a page in the browser; Ctrl-C ends it."""
    with needs_extra("viewer"):
        from companion.core.secret import read_token  # noqa: PLC0415
        from companion.view.access.server import open_page  # noqa: PLC0415
        from companion.view.feed_client import parse_address  # noqa: PLC0415
        from companion.view.live import Live  # noqa: PLC0415 - an extra

    address = parse_address(drone)
    token = read_token(drone_token_file, "--drone-token-file") if drone_token_file else ""
    is_over = until_interrupted()
    server, page_address = open_page(host, port, token_file, "PDPS companion")
    page = Live(server, address, token)
    print(f"open     {page_address}", flush=True)
    if browser:
        open_in_browser(page_address)
    try:
        page.run(is_over)
    finally:
        page.close()
