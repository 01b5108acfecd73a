"""Authorizes every request for the page before viser's server handles it.

Without a token, the Host header must name the loopback interface. This blocks DNS rebinding, where
another site's name resolves to this machine. An Origin header must match the Host. With a
token, a request must carry it: first in the address, `/?token=...`, then in a cookie.
"""

import hmac
from collections.abc import Callable
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from websockets import Headers
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from companion.core.secret import is_loopback

Answer = Callable[[ServerConnection, Request], Response | None]

TWICE = "A request must have one Host and at most one Origin; a proxy may have added another."
OTHER_SITE = (
    "This request has Host {host!r} and Origin {origin!r}, which differ: another site sent it, "
    "or a proxy changed them. A proxy must pass Host as the browser sends it, with its port; "
    "for nginx: proxy_set_header Host $http_host;"
)
NOT_FROM_HERE = (
    "This page is only for the machine that it runs on, and the request has Host {host!r}: open "
    "127.0.0.1 or localhost, or allow other machines with --token-file and --host."
)
NO_TOKEN = "This page needs its token: open the printed address with ?token=..."
WRONG_TOKEN = (
    "The token in {place} is not this page's: open the address with ?token=... "
    "that was printed when the page was last started."
)
USUAL_PORTS = {"http": 80, "https": 443}
"""Default port of each scheme."""
SHOWN = 100
"""Largest number of characters of a header that a refusal quotes. Chosen."""


class Guard:
    """Requires `token` in every request; if it is None, allows only this machine."""

    def __init__(self, token: str | None, port: int) -> None:
        self._token = token
        self._cookie = f"pdps_view_{port}"  # cookies do not distinguish ports

    def before(self, answer: Answer) -> Answer:
        """Wrap `answer` so that it only handles authorized requests."""

        def guarded(connection: ServerConnection, request: Request) -> Response | None:
            return self.refusal(request) or answer(connection, request)

        return guarded

    def refusal(self, request: Request) -> Response | None:
        """Response that replaces the page; None if the request is authorized."""
        # get_all: a duplicate header is ambiguous
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or len(origins) > 1:
            return _refuse(TWICE)
        host = hosts[0]
        if origins and not _is_at(origins[0], host):
            return _refuse(OTHER_SITE.format(host=host[:SHOWN], origin=origins[0][:SHOWN]))
        if self._token is None:
            is_ours = is_loopback(_host_name(host))
            return None if is_ours else _refuse(NOT_FROM_HERE.format(host=host[:SHOWN]))
        return self._without_token(request)

    def _without_token(self, request: Request) -> Response | None:
        """Response to a request without a valid cookie; None if the cookie is valid."""
        in_cookie, in_address = self._in_cookie(request), _in_address(request)
        if self._is_token(in_cookie):
            return None
        if self._is_token(in_address):
            return self._let_in()
        if in_address:
            return _refuse(WRONG_TOKEN.format(place="the address"))
        return _refuse(WRONG_TOKEN.format(place="the browser's cookie") if in_cookie else NO_TOKEN)

    def _is_token(self, candidate: str) -> bool:
        return hmac.compare_digest(candidate.encode(), (self._token or "").encode())

    def _in_cookie(self, request: Request) -> str:
        try:
            cookies = SimpleCookie("; ".join(request.headers.get_all("Cookie")))
        except CookieError:
            return ""
        return cookies[self._cookie].value if self._cookie in cookies else ""

    def _let_in(self) -> Response:
        """Redirect that sets the cookie and removes the token from the address bar."""
        cookie = f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict"
        # relative, because a proxy may serve the page below a path
        headers = Headers({"Location": "./", "Set-Cookie": cookie, "Content-Length": "0"})
        return Response(HTTPStatus.SEE_OTHER, "See Other", headers)


def _is_at(origin: str, host: str) -> bool:
    """Test whether an origin matches a host; the scheme's default port may be explicit."""
    try:
        site = urlsplit(origin)
        port = USUAL_PORTS.get(site.scheme)
        there = urlsplit(f"//{host}")
        ours, its = (there.hostname, there.port or port), (site.hostname, site.port or port)
        return bool(site.hostname) and its == ours
    except ValueError:  # no host, or no port
        return False


def _host_name(host: str) -> str:
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _in_address(request: Request) -> str:
    return parse_qs(urlsplit(request.path).query).get("token", [""])[0]


def _refuse(reason: str) -> Response:
    body = f"{reason}\n".encode()
    headers = Headers({"Content-Type": "text/plain", "Content-Length": str(len(body))})
    return Response(HTTPStatus.FORBIDDEN, "Forbidden", headers, body)
