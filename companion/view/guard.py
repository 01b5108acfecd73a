"""Nobody gets at the page who may not: asked at every request, before the page's own server is.

On this machine a request must name it as its host, which another site's page that has made a name
of its own point here cannot; and a WebSocket must come from the page itself. From elsewhere it must
have the token: once in the address, `/?token=...`, from then on in a cookie.
"""

import hmac
from collections.abc import Callable
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from websockets import Headers
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from companion.view.secret import is_loopback

Answer = Callable[[ServerConnection, Request], Response | None]

NOT_FROM_HERE = "This page is only for the machine that it runs on."
NO_TOKEN = "This page needs its token: open the address with ?token=... that was printed."


class Guard:
    """`token` is needed wherever it is given; without one, only this machine comes in."""

    def __init__(self, token: str | None, port: int) -> None:
        self._token = token
        self._cookie = f"pdps_view_{port}"  # cookies do not tell ports apart

    def before(self, answer: Answer) -> Answer:
        """Answers as `answer` does, to those who may ask."""

        def guarded(connection: ServerConnection, request: Request) -> Response | None:
            return self.refusal(request) or answer(connection, request)

        return guarded

    def refusal(self, request: Request) -> Response | None:
        """What a request gets instead of the page; None if it may pass."""
        # get_all: a header that stands there twice is not to be read in two ways
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or len(origins) > 1:
            return _refuse(NOT_FROM_HERE)
        if origins and urlsplit(origins[0]).netloc.lower() != hosts[0].lower():
            return _refuse(NOT_FROM_HERE)
        if self._token is None:
            is_ours = is_loopback(urlsplit(f"//{hosts[0]}").hostname or "")
            return None if is_ours else _refuse(NOT_FROM_HERE)
        if self._is_token(self._in_cookie(request)):
            return None
        if self._is_token(_in_address(request)):
            return self._let_in()
        return _refuse(NO_TOKEN)

    def _is_token(self, told: str) -> bool:
        return hmac.compare_digest(told.encode(), (self._token or "").encode())

    def _in_cookie(self, request: Request) -> str:
        try:
            cookies = SimpleCookie("; ".join(request.headers.get_all("Cookie")))
        except CookieError:
            return ""
        return cookies[self._cookie].value if self._cookie in cookies else ""

    def _let_in(self) -> Response:
        """The page once more, without the token in the address bar."""
        cookie = f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict"
        headers = Headers({"Location": "/", "Set-Cookie": cookie, "Content-Length": "0"})
        return Response(HTTPStatus.SEE_OTHER, "See Other", headers)


def _in_address(request: Request) -> str:
    return parse_qs(urlsplit(request.path).query).get("token", [""])[0]


def _refuse(reason: str) -> Response:
    body = f"{reason}\n".encode()
    headers = Headers({"Content-Type": "text/plain", "Content-Length": str(len(body))})
    return Response(HTTPStatus.FORBIDDEN, "Forbidden", headers, body)
