"""Serves the topics of a recording over Foxglove's WebSocket protocol.

The server of foxglove-sdk runs in threads of its own. It keeps at most `BACKLOG` messages for each
client and drops the oldest, so no caller waits for a client. A client that has not read as many
times of the clock is disconnected.

Clients only listen: the server offers them no parameters, services or messages of their own. The
protocol has no token. Therefore an address that other machines reach needs `view.foxglove_open`.
"""

import logging
import threading

from foxglove import Channel, Context, Schema, start_server
from foxglove.websocket import (
    Capability,
    ChannelView,
    Client,
    ServerListener,
    WebSocketServer,
)

from companion.config.view import ViewConfig
from companion.core.errors import ViewError
from companion.core.secret import is_loopback
from companion.recording import topics
from companion.recording.foxglove import to_ns

BACKLOG = 512
"""Largest number of messages that wait for a client. Chosen: 9 s of a flight in real time."""
SERVER_NAME = "PDPS companion"
"""Name of the server in Foxglove."""


class TopicServer:
    """A channel for each topic; port 0 of the address selects a free port.

    Raises:
        ViewError: other machines can reach `view.foxglove` and `view.foxglove_open` is false, or
            the address cannot be used.
    """

    def __init__(self, view: ViewConfig) -> None:
        self._host, _, port = view.foxglove.rpartition(":")
        if not is_loopback(self._host) and not view.foxglove_open:
            raise ViewError(
                f"view.foxglove = {view.foxglove!r}: others can reach this address, and Foxglove "
                f"has no token: use 127.0.0.1:{port} through ssh -L {port}:127.0.0.1:{port}, or "
                "set view.foxglove_open = true"
            )
        self._context = Context()  # the server and the channels do not keep it
        self._channels = {each.topic: _channel(each, self._context) for each in topics.described()}
        self._subscribed = _Subscribed()
        self._server = _start(view.foxglove, int(port), self._context, self._subscribed)

    @property
    def port(self) -> int:
        return self._server.port

    @property
    def url(self) -> str:
        """Address to open in Foxglove."""
        return f"ws://{self._host}:{self.port}"

    @property
    def has_clients(self) -> bool:
        """True while a client receives any topic."""
        return any(channel.has_sinks() for channel in self._channels.values())

    def is_received(self, topic: str) -> bool:
        """True while a client receives this topic."""
        return self._channels[topic].has_sinks()

    def newly_received(self) -> set[str]:
        """Topics to which clients have subscribed since the last call."""
        return self._subscribed.take()

    def set_time(self, time_s: float) -> None:
        """Set the clock of the clients, which is the flight's own."""
        self._server.broadcast_time(to_ns(time_s))

    def add(self, topic: str, time_s: float, data: bytes) -> None:
        """Send a message to the clients that receive its topic."""
        self._channels[topic].log(data, log_time=to_ns(time_s))

    def close(self) -> None:
        """End all connections at once; messages that wait are dropped."""
        self._server.stop()


class _Subscribed(ServerListener):
    """Collects new subscriptions; the server calls it in a thread of its own."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._topics: set[str] = set()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        with self._lock:
            self._topics.add(channel.topic)

    def take(self) -> set[str]:
        with self._lock:
            taken, self._topics = self._topics, set()
        return taken


def _channel(described: topics.Described, context: Context) -> Channel:
    schema = Schema(
        name=described.schema_name, encoding=described.schema_encoding, data=described.schema
    )
    encoding = described.message_encoding
    return Channel(described.topic, schema=schema, message_encoding=encoding, context=context)


def _start(address: str, port: int, context: Context, listener: ServerListener) -> WebSocketServer:
    # it logs each message that a lost client did not receive: hundreds of lines among the flight's
    logging.getLogger("foxglove").setLevel(logging.CRITICAL)
    try:
        return start_server(
            name=SERVER_NAME,
            host=address.rpartition(":")[0],
            port=port,
            capabilities=[Capability.Time],
            server_listener=listener,
            context=context,
            message_backlog_size=BACKLOG,
        )
    except (RuntimeError, OverflowError) as error:
        reason = str(error).removeprefix("FoxgloveError: ")
        raise ViewError(f"view.foxglove = {address!r}: {reason}; choose another port") from error
