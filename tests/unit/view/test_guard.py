"""Tests the access check of the page over real connections."""

from collections.abc import Iterator, Mapping
from contextlib import closing
from email.message import Message
from http.client import HTTPConnection
from pathlib import Path

import pytest
from websockets import Headers
from websockets.exceptions import InvalidStatus
from websockets.http11 import Request
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from companion.core.errors import SecretError, ViewError
from companion.core.secret import answer, is_loopback, read_token
from companion.view.access.guard import Guard
from companion.view.access.server import PageServer, open_page
from tests.waiting import DEADLINE_S

TOKEN = "0123456789abcdef"


@pytest.fixture
def token_file(tmp_path: Path) -> Path:
    file = tmp_path / "token"
    file.write_text(TOKEN + "\n")
    file.chmod(0o600)
    return file


@pytest.fixture
def local() -> Iterator[PageServer]:
    """A page without a token, for this machine only."""
    server, _ = open_page("127.0.0.1", 0, None, "test")
    yield server
    server.stop()


@pytest.fixture
def public(token_file: Path) -> Iterator[PageServer]:
    """A page that requires the token."""
    server, _ = open_page("0.0.0.0", 0, token_file, "test")
    yield server
    server.stop()


def refusal(headers: Mapping[str, str], path: str = "/", token: str | None = TOKEN) -> str:
    """Text of the refusal of a request; empty if the guard admits it."""
    refused = Guard(token, 8080).refusal(Request(path, Headers(headers)))
    return refused.body.decode() if refused and refused.status_code == 403 else ""


def get(
    server: PageServer, path: str = "/", headers: Mapping[str, str] | None = None
) -> tuple[int, Message]:
    """Status and headers of a response."""
    connection = HTTPConnection("127.0.0.1", server.get_port(), timeout=DEADLINE_S)
    with closing(connection):
        connection.request("GET", path, headers=dict(headers or {}))
        with connection.getresponse() as response:
            return response.status, response.headers


def open_socket(
    server: PageServer, origin: str | None = None, headers: Mapping[str, str] | None = None
) -> int:
    """Status of a WebSocket handshake like the page's."""
    try:
        with connect(
            f"ws://127.0.0.1:{server.get_port()}",
            origin=Origin(origin) if origin else None,
            additional_headers=dict(headers or {}),
            subprotocols=[Subprotocol("viser-v0")],
            open_timeout=DEADLINE_S,
        ):
            return 101
    except InvalidStatus as refused:
        return refused.response.status_code


def test_this_machine_gets_the_page(local: PageServer) -> None:
    port = local.get_port()
    assert get(local)[0] == 200
    assert get(local, headers={"Host": f"localhost:{port}"})[0] == 200
    assert open_socket(local, origin=f"http://127.0.0.1:{port}") == 101


def test_another_site_cannot_reach_the_page_through_the_browser(local: PageServer) -> None:
    assert get(local, headers={"Host": "evil.example"})[0] == 403
    assert open_socket(local, origin="http://evil.example") == 403
    assert open_socket(local, origin=f"http://evil.example:{local.get_port()}") == 403
    assert open_socket(local, origin="null") == 403


def test_page_files_and_socket_are_refused_without_the_token(public: PageServer) -> None:
    for path in ("/", "/index.html", "/?token=", "/?token=0123456789abcdeF", "/assets/x.js"):
        assert get(public, path)[0] == 403
    assert open_socket(public) == 403
    assert open_socket(public, headers={"Cookie": f"pdps_view_{public.get_port()}=wrong"}) == 403
    assert open_socket(public, headers={"Cookie": "pdps_view_1=" + TOKEN}) == 403


def test_the_token_gives_access_and_is_removed_from_the_address(public: PageServer) -> None:
    status, headers = get(public, f"/?token={TOKEN}")
    assert (status, headers["Location"]) == (303, "./")
    cookie = headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    with_cookie = {"Cookie": cookie.partition(";")[0]}
    assert get(public, headers=with_cookie)[0] == 200
    assert open_socket(public, headers=with_cookie) == 101
    assert open_socket(public, origin="http://evil.example", headers=with_cookie) == 403


COOKIE = f"pdps_view_8080={TOKEN}"


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("maps.example", "https://maps.example:8443"),
        ("maps.example:8443", "https://maps.example"),
        ("127.0.0.1:8080", "https://maps.example"),
        ("maps.example:8080", "https://maps.example"),
    ],
)
def test_a_refusal_names_the_host_that_a_proxy_changed(host: str, origin: str) -> None:
    for token in (TOKEN, None):
        refused = refusal({"Host": host, "Origin": origin, "Cookie": COOKIE}, token=token)
        assert repr(host) in refused
        assert repr(origin) in refused
        assert "proxy must pass Host" in refused
        assert "only for the machine" not in refused


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("maps.example:8443", "https://maps.example:8443"),
        ("maps.example", "https://maps.example"),
        ("maps.example:443", "https://maps.example"),
        ("Maps.example", "http://maps.example:80"),
        ("[::1]:8080", "http://[::1]:8080"),
    ],
)
def test_a_proxy_that_passes_the_host_is_admitted(host: str, origin: str) -> None:
    assert refusal({"Host": host, "Origin": origin, "Cookie": COOKIE}) == ""


def test_missing_and_wrong_tokens_are_refused_with_different_texts() -> None:
    host = {"Host": "maps.example"}
    assert "needs its token" in refusal(host)
    assert "token in the address is not" in refusal(host, "/?token=0123456789abcdeF")
    of_before = {**host, "Cookie": "pdps_view_8080=fedcba9876543210"}
    assert "token in the browser's cookie is not" in refusal(of_before)
    assert refusal(of_before, f"/?token={TOKEN}") == ""


def test_another_host_and_invalid_headers_are_refused_with_different_texts() -> None:
    assert "Host 'evil.example'" in refusal({"Host": "evil.example"}, token=None)
    assert "machine that it runs on" in refusal({"Host": "evil.example"}, token=None)
    assert "one Host" in refusal({}, token=None)
    assert "differ" in refusal({"Host": "", "Origin": "null"}, token=None)
    assert "differ" in refusal({"Host": "127.0.0.1:x", "Origin": "http://[::"}, token=None)


def test_the_page_cannot_be_shared_publicly(local: PageServer) -> None:
    assert local.request_share_url() is None


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.2", "drone.local", "::"])
def test_an_address_that_others_reach_needs_a_token(host: str) -> None:
    with pytest.raises(ViewError, match=r"--host .*--token-file.*openssl rand"):
        open_page(host, 0, None, "test")


def test_a_port_in_use_is_reported(local: PageServer) -> None:
    with pytest.raises(ViewError, match=rf"--port {local.get_port()}: Address already in use"):
        open_page("127.0.0.1", local.get_port(), None, "test")


def test_a_token_is_long_and_its_file_private(tmp_path: Path, token_file: Path) -> None:
    assert read_token(token_file, "--token-file") == TOKEN
    token_file.chmod(0o644)
    with pytest.raises(SecretError, match=r"--token-file .*mode 644.*chmod 600"):
        read_token(token_file, "--token-file")
    token_file.chmod(0o600)
    token_file.write_text("short")
    with pytest.raises(SecretError, match="16 letters and digits"):
        read_token(token_file, "--token-file")
    with pytest.raises(SecretError, match="No such file"):
        read_token(tmp_path / "none", "--token-file")


def test_loopback_addresses_are_recognized() -> None:
    assert all(map(is_loopback, ("localhost", "127.0.0.1", "127.1.2.3", "::1")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "192.168.1.2", "127.0.0.1.evil.example")))


def test_an_answer_depends_on_challenge_and_token() -> None:
    assert answer(TOKEN, b"a") != answer(TOKEN, b"b")
    assert answer(TOKEN, b"a") != answer("another", b"a")
