"""Gives the page its title and icon, and passes dropped files to its upload button."""

import gzip
import html
import re
from urllib.parse import quote

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from companion.view.access.guard import Answer

ICON = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32">
<rect width="32" height="32" rx="6" fill="#2a9d8f"/>
<path d="M6 19V6h20v20H13" fill="none" stroke="#fff" stroke-width="3"/>
<path d="M6 26l8-8" stroke="#f4a261" stroke-width="3"/>
<circle cx="16" cy="16" r="3" fill="#f4a261"/></svg>"""
"""A room with a door, and in it a drone with its beam."""
DROP = """<script>
addEventListener("dragover", event => event.preventDefault());
addEventListener("drop", event => {
  event.preventDefault();
  const input = document.querySelector("input[type=file]");
  if (!input || !event.dataTransfer.files.length) return;
  input.files = event.dataTransfer.files;
  input.dispatchEvent(new Event("change", {bubbles: true}));
});
</script>"""
"""Passes a file that is dropped anywhere on the page to its upload button, if it has one."""
_ITS_TITLE = re.compile(rb"<title>.*?</title>", re.DOTALL)
_ITS_ICON = re.compile(rb'<link\s+rel="icon".*?/>', re.DOTALL)


def branded(answer: Answer, title: str) -> Answer:
    """Wrap `answer` so that the page has this title and our icon."""
    pages: dict[bytes, bytes] = {}
    """Our page by that of viser: compressing it takes 50 ms."""

    def answered(connection: ServerConnection, request: Request) -> Response | None:
        response = answer(connection, request)
        if response is None or not response.headers.get("Content-Type", "").startswith("text/html"):
            return response
        body = bytes(response.body)
        if body not in pages:
            is_packed = response.headers.get("Content-Encoding") == "gzip"
            page = _with_head(gzip.decompress(body) if is_packed else body, title)
            pages[body] = gzip.compress(page) if is_packed else page
        response.body = pages[body]
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))
        return response

    return answered


def _with_head(page: bytes, title: str) -> bytes:
    """The page with our title, icon and script in its head."""
    icon = f'<link rel="icon" href="data:image/svg+xml,{quote(ICON)}"/>'
    head = f"<title>{html.escape(title)}</title>{icon}{DROP}".encode()
    return _ITS_TITLE.sub(lambda _: head, _ITS_ICON.sub(b"", page, count=1), count=1)
