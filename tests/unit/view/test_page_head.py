"""Tests the title and the icon of the page that is served."""

import gzip
import urllib.request
from collections.abc import Iterator

import pytest

from companion.view.access.server import PageServer, open_page
from tests.waiting import DEADLINE_S


@pytest.fixture
def server() -> Iterator[PageServer]:
    server, _ = open_page("127.0.0.1", 0, None, "PDPS <test>")
    yield server
    server.stop()


@pytest.mark.parametrize("encoding", ["gzip", "identity"])
def test_the_page_has_its_own_title_and_icon(server: PageServer, encoding: str) -> None:
    address = f"http://127.0.0.1:{server.get_port()}/"
    request = urllib.request.Request(address, headers={"Accept-Encoding": encoding})
    with urllib.request.urlopen(request, timeout=DEADLINE_S) as response:
        body = response.read()
        assert int(response.headers["Content-Length"]) == len(body)
    if encoding == "gzip":
        body = gzip.decompress(body)
    head = body[:20_000].decode(errors="replace")
    assert "<title>PDPS &lt;test&gt;</title>" in head
    assert head.count('rel="icon"') == 1
    assert "<title>Viser" not in head
