"""Receives snapshots from a drone's feed; the viewer's end of the view protocol."""

import contextlib
import socket
import threading
from collections.abc import Callable

import msgspec

from companion.core.errors import ViewError
from companion.core.secret import answer
from companion.view.feed import CHALLENGE_BYTES, GREETING, LENGTH, PATIENCE_S
from companion.view.snapshot import Snapshot, decode

FEED_PORT = 5795
"""Default TCP port of the feed. Chosen."""
MAX_BYTES = 1 << 24
"""Largest size of a snapshot, bytes. Chosen."""
SILENT_S = 10.0
"""Receive timeout, s. Chosen: a flying drone sends ten snapshots a second."""
RETRY_S = 1.0
"""Time between attempts to reconnect, s. Chosen."""


def parse_address(text: str) -> tuple[str, int]:
    """Parse HOST or HOST:PORT.

    Raises:
        ViewError: the text is neither.
    """
    host, colon, port = text.rpartition(":")
    if not colon:
        return text, FEED_PORT
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ViewError(f"{text}: should be HOST or HOST:PORT; the default port is {FEED_PORT}")
    return host, int(port)


class FeedClient:
    """Receives in a thread, passing snapshots to `tell` and connection errors to `complain`.

    The thread reconnects after an error.

    Raises:
        ViewError: no companion responds at the address.
    """

    def __init__(
        self,
        address: tuple[str, int],
        token: str,
        tell: Callable[[Snapshot], None],
        complain: Callable[[str], None],
    ) -> None:
        self._address = address
        self._token = token
        self._tell = tell
        self._complain = complain
        self._is_closed = threading.Event()
        self._socket = self._connect()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._is_closed.set()
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join(PATIENCE_S)
        self._socket.close()

    def _connect(self) -> socket.socket:
        host, port = self._address
        where = f"{host}:{port}"
        try:
            drone = socket.create_connection(self._address, PATIENCE_S)
        except OSError as error:
            reason = error.strerror or "no response"
            raise ViewError(
                f"{where}: {reason}; the drone's configuration needs view.listen, "
                "and a flight must be running"
            ) from error
        try:
            if _read(drone, len(GREETING)) != GREETING:
                raise ViewError(f"{where}: not a companion, or a different version")
            drone.sendall(answer(self._token, _read(drone, CHALLENGE_BYTES)))
            drone.settimeout(SILENT_S)
        except OSError as error:
            drone.close()
            raise (
                error if isinstance(error, ViewError) else ViewError(f"{where}: {error}")
            ) from error
        return drone

    def _listen(self) -> None:
        has_heard = False
        while not self._is_closed.is_set():
            try:
                (length,) = LENGTH.unpack(_read(self._socket, LENGTH.size))
                if length > MAX_BYTES:
                    raise ViewError(f"a snapshot of {length} bytes is too large")
                self._tell(decode(_read(self._socket, length)))
                has_heard = True
            except (OSError, msgspec.MsgspecError) as error:
                if self._is_closed.is_set():
                    return
                hint = "" if has_heard else "; check that --drone-token-file is the drone's token"
                self._complain(f"no data from the drone: {error}{hint}")
                self._connect_again()

    def _connect_again(self) -> None:
        self._socket.close()
        while not self._is_closed.wait(RETRY_S):
            with contextlib.suppress(ViewError):
                self._socket = self._connect()
                return


def _read(drone: socket.socket, count: int) -> bytes:
    """Read exactly `count` bytes."""
    data = b""
    while len(data) < count:
        piece = drone.recv(count - len(data))
        if not piece:
            raise ConnectionError("the connection was closed")
        data += piece
    return data
