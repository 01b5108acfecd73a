"""Serves snapshots of the flight to viewers over TCP; the drone's end of the view protocol.

    drone  ─► "PDPS view 1", a line feed, 16 bytes of challenge
    viewer ─► HMAC-SHA256(token, challenge), 32 bytes
    drone  ─► length, 4 bytes, big endian; a snapshot in MessagePack; repeated

The drone reads nothing from a viewer after the challenge response. The control loop never waits for
a viewer, and creates no snapshots without one. A slow viewer skips snapshots, but always receives
the latest map.
"""

import contextlib
import hmac
import secrets
import socket
import socketserver
import struct
import threading
from collections.abc import Callable, Iterator
from typing import Protocol

from companion.app import App
from companion.config.settings import Config
from companion.core.errors import ViewError
from companion.core.secret import answer, is_loopback, needs_token, read_token
from companion.ticks import Inputs, Outputs
from companion.view.snapshot import encode, snapshot

GREETING = b"PDPS view 1\n"
"""First bytes from the drone; the number is the version of the protocol."""
CHALLENGE_BYTES, ANSWER_BYTES = 16, 32
"""Length of the challenge, and of an HMAC-SHA256, bytes."""
LENGTH = struct.Struct(">I")
"""Length of a snapshot, bytes, before the snapshot."""
PERIOD_S = 0.1
"""Time between snapshots, s. Chosen."""
SKETCH_PERIOD_S = 1.0
"""Time between snapshots that contain the map, s. Chosen."""
PATIENCE_S = 5.0
"""Timeout of a viewer that does not respond or does not receive, s. Chosen."""
MAX_LOOKERS = 8
"""Largest number of viewer connections, admitted or not. Chosen."""


class Feed(Protocol):
    """Receives every tick of the control loop for publication to viewers."""

    def tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None: ...

    def close(self) -> None: ...


class NoFeed:
    """A feed without viewers, for a configuration without view.listen."""

    def tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        pass

    def close(self) -> None:
        pass


def open_feed(config: Config, app: App, warn: Callable[[str], None]) -> Feed:
    """Open the feed that [view] of the configuration describes.

    Raises:
        ViewError: the address is reachable from other machines and there is no token, or the
            address is in use.
    """
    view = config.view
    if not view.listen:
        return NoFeed()
    host, _, port = view.listen.rpartition(":")
    if view.token_file is None and not is_loopback(host):
        raise ViewError(needs_token("view.listen =", repr(view.listen), "view.token_file"))
    token = read_token(view.token_file, "view.token_file =") if view.token_file else ""
    try:
        return TcpFeed((host, int(port)), token, app, config, warn)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ViewError(f"view.listen = {view.listen!r}: {reason}; choose another port") from error


class TcpFeed:
    """Holds the latest snapshot and the latest map for the threads of all viewers."""

    def __init__(
        self,
        address: tuple[str, int],
        token: str,
        app: App,
        config: Config,
        warn: Callable[[str], None],
    ) -> None:
        self._token = token
        self._app = app
        self._config = config
        self._warn = warn
        self._sent_s = self._sketched_s = float("-inf")
        self._lookers = 0
        self._seats = threading.Semaphore(MAX_LOOKERS)
        self._is_closed = False
        self._news = threading.Condition()
        self._number = self._sketch_number = 0
        self._latest = self._sketched = b""
        feed = self

        class FeedClient(socketserver.BaseRequestHandler):
            def handle(self) -> None:
                feed._serve(self.request)

        self._server = _Server(address, FeedClient)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def port(self) -> int:
        port: int = self._server.server_address[1]
        return port

    def tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        """Publish a snapshot if one is due; an error closes the feed but not the flight."""
        if self._is_closed or not self._lookers:
            return
        is_due = now_s - self._sent_s >= PERIOD_S - 1e-6
        if not is_due and not outputs.finished:
            return
        self._sent_s = now_s
        try:
            self._tell(now_s, inputs, outputs)
        except Exception as error:
            self._warn(f"the view feed is closed: {error!r}")
            self._send_away()

    def _tell(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        with_sketch = now_s - self._sketched_s >= SKETCH_PERIOD_S or outputs.finished
        seen = now_s, inputs, outputs
        frame = encode(snapshot(self._app, *seen, self._config, with_sketch=with_sketch))
        with self._news:
            self._number += 1
            self._latest = LENGTH.pack(len(frame)) + frame
            if with_sketch:
                self._sketched_s = now_s
                self._sketched, self._sketch_number = self._latest, self._number
            self._news.notify_all()

    def close(self) -> None:
        self._send_away()
        self._server.shutdown()
        self._server.server_close()

    def _send_away(self) -> None:
        """Close the connections of all viewers, without waiting for them."""
        with self._news:
            self._is_closed = True
            self._news.notify_all()

    def _serve(self, client: socket.socket) -> None:
        """Serve one viewer; runs in the viewer's thread."""
        client.settimeout(PATIENCE_S)
        if not self._seats.acquire(blocking=False):
            return
        try:
            if self._is_admitted(client):
                with self._looking():
                    self._send_snapshots(client)
        except OSError:
            return  # the viewer has disconnected
        finally:
            self._seats.release()

    @contextlib.contextmanager
    def _looking(self) -> Iterator[None]:
        with self._news:
            self._lookers += 1
        try:
            yield
        finally:
            with self._news:
                self._lookers -= 1

    def _is_admitted(self, client: socket.socket) -> bool:
        challenge = secrets.token_bytes(CHALLENGE_BYTES)
        client.sendall(GREETING + challenge)
        response = b""
        while len(response) < ANSWER_BYTES:
            piece = client.recv(ANSWER_BYTES - len(response))
            if not piece:
                return False
            response += piece
        return hmac.compare_digest(response, answer(self._token, challenge))

    def _send_snapshots(self, client: socket.socket) -> None:
        sent = 0
        while (news := self._since(sent)) is not None:
            sent, frames = news
            client.sendall(frames)

    def _since(self, sent: int) -> tuple[int, bytes] | None:
        """Number and bytes of the latest snapshot; None when the feed is closed.

        The latest snapshot with a map precedes it if this viewer has not received that one.
        """
        with self._news:
            self._news.wait_for(lambda: self._is_closed or self._number > sent)
            if self._number == sent:
                return None
            has_missed_map = sent < self._sketch_number < self._number
            frames = self._sketched + self._latest if has_missed_map else self._latest
            return self._number, frames


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False
