"""Transports MAVLink messages over UDP, as bytes through memory, or as message objects.

All three deliver bit-identical messages. The emulated autopilot of SITL uses the same classes for
its end.
"""

import errno
import re
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.errors import LinkError
from companion.link.signing import Signing, SigningCodec
from companion.link.transports.peers import Address, Peers

URL_PATTERN = r"(udpin|udpout):[^:]+:\d{1,5}"
"""Format of a UDP link URL."""
Message = Any
"""A pymavlink message object: `get_type()`, `get_srcSystem()`, and its fields as attributes."""


AUTOPILOT_COMPONENT: int = mavlink.MAV_COMP_ID_AUTOPILOT1
COMPANION_COMPONENT: int = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
"""Component ids of the two ends of an in-process link; both have the vehicle's system id."""


class Transport(Protocol):
    """One end of a link."""

    def receive(self) -> list[Message]:
        """All received messages; never blocks."""
        ...

    def send(self, message: Message) -> None:
        """Send the whole message or drop it without an error, like a radio; never blocks."""
        ...

    def close(self) -> None: ...


def make_codec(system_id: int, component_id: int, signing: Signing | None = None) -> Any:
    """Create pymavlink's encoder and parser; all transports use this function."""
    kind = mavlink.MAVLink if signing is None else SigningCodec
    codec = kind(None, srcSystem=system_id, srcComponent=component_id)
    codec.robust_parsing = True
    if signing is not None:
        codec.signing = signing
    return codec


def sent_by(message: Message, component_id: int, number: int) -> Message:
    """Mark a message as sent by another component of ours, with its own sequence number."""
    message.sent_by = component_id, number % 256
    return message


FIRST_BYTES = (b"\xfd", b"\xfe")
"""First byte of a frame of MAVLink 2 and of MAVLink 1."""
QUIET_S = 0.05
"""Silence after which all datagrams of a tick have arrived, s. Chosen: on one machine they take
less than 1 ms, but its processor may be busy."""


def frame(codec: Any, message: Message) -> bytes:
    """Bytes of a message, with the ids of the component that sends it."""
    ours = codec.srcComponent, codec.seq
    other = getattr(message, "sent_by", None)
    codec.srcComponent, codec.seq = other or ours
    data: bytes = message.pack(codec)
    codec.srcComponent, codec.seq = ours[0], (ours[1] + (other is None)) % 256
    return data


def decode(codec: Any, data: bytes) -> list[Message]:
    """Complete messages in a packet, without invalid and unknown ones.

    An incomplete message at the end is discarded; otherwise it would corrupt the next packet.
    """
    messages = decode_stream(codec, data)
    discard_incomplete(codec)
    return messages


def discard_incomplete(codec: Any) -> None:
    """Discard the beginning of a message whose end has not arrived."""
    if codec.buf_len():
        codec.buf, codec.buf_index = bytearray(), 0
        codec.expected_length = mavlink.HEADER_LEN_V1 + 2


def decode_stream(codec: Any, data: bytes) -> list[Message]:
    """Complete messages in a stream so far; the beginning of the next one is kept.

    The message id is read with `get_msgId()`, not from `id`: some messages have a field of that
    name.
    """
    messages = codec.parse_buffer(data) or []
    return [
        m for m in messages if m.get_type() != "BAD_DATA" and m.get_msgId() in mavlink.mavlink_map
    ]


def _remedy(error: OSError | OverflowError | UnicodeError, host: str) -> str:
    """Remedy for a UDP address that cannot be used."""
    if isinstance(error, OverflowError):
        return "choose a port up to 65535"
    if isinstance(error, socket.gaierror | UnicodeError):
        return f"is the network up, and {host} the right name? write its IP address"
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{host} is no address of this computer: write 0.0.0.0, or udpout to send there"
    if error.errno == errno.EACCES:
        return "choose a port from 1024 on"
    return "is another program using it? choose another port"


class UdpTransport:
    """MAVLink in datagrams.

    "udpin:HOST:PORT" waits for a peer; "udpout:HOST:PORT" sends first. With udpin, port 0 selects
    a free port.

    Only messages of the link's peer are accepted; see `peers`. A bridge from a serial port to UDP
    may divide a message between two datagrams.

    Raises:
        LinkError: the address cannot be used.
    """

    def __init__(
        self, url: str, system_id: int, component_id: int, signing: Signing | None = None
    ) -> None:
        if not re.fullmatch(URL_PATTERN, url):
            raise LinkError(f"{url}: not a link; write udpin:HOST:PORT or udpout:HOST:PORT")
        kind, host, port = url.split(":")
        self._url = url
        self._codec = make_codec(system_id, component_id, signing)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._waiting: list[Message] = []
        self._last_sender: Address | None = None
        self.messages_dropped = 0
        """Messages that the kernel had no buffer or no route for."""
        try:
            if kind == "udpin":
                self._socket.bind((host, int(port)))
                self._peers = Peers(None)
            else:
                self._socket.bind(("", 0))
                self._peers = Peers((socket.gethostbyname(host), int(port)))
        except (OSError, OverflowError, UnicodeError) as error:
            self._socket.close()
            raise LinkError(f"{url}: {error}; {_remedy(error, host)}") from error

    @property
    def local_port(self) -> int:
        port: int = self._socket.getsockname()[1]
        return port

    @property
    def address(self) -> str:
        """URL of this end, with the selected port in place of port 0."""
        start, _, port = self._url.rpartition(":")
        return f"{start}:{self.local_port if port == '0' else port}"

    @property
    def peer_port(self) -> int | None:
        address = self._peers.peer.address
        return address[1] if address else None

    @property
    def datagrams_sent(self) -> int:
        """Number of datagrams sent to the peer."""
        return self._peers.peer.datagrams_sent

    @property
    def datagrams_received(self) -> int:
        """Number of datagrams received from the peer."""
        return self._peers.peer.datagrams_received

    def receive(self) -> list[Message]:
        self._drain()
        waiting, self._waiting = self._waiting, []
        return waiting

    def _drain(self) -> None:
        """Receive all that has arrived; the peer may stand behind others in the queue."""
        arrived = [(sender, self._decode(sender, data)) for sender, data in self._datagrams()]
        heard = [(sender, messages) for sender, messages in arrived if messages]
        self._peers.hear([sender for sender, _ in heard], time.monotonic())
        peer = self._peers.peer
        for sender, messages in heard:
            if sender == peer.address:
                peer.datagrams_received += 1
                self._waiting += messages

    def _decode(self, sender: Address, data: bytes) -> list[Message]:
        """Complete messages; this datagram may continue the one before of the same sender."""
        if sender != self._last_sender or data[:1] in FIRST_BYTES:
            discard_incomplete(self._codec)
        self._last_sender = sender
        return decode_stream(self._codec, data)

    def _datagrams(self) -> Iterator[tuple[Address, bytes]]:
        while True:
            try:
                data, sender = self._socket.recvfrom(65535)
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno == errno.ECONNREFUSED:  # no receiver yet: ICMP of an earlier send
                    continue
                return
            yield sender, data

    def await_datagrams(self, total: int, timeout_s: float) -> None:
        """Wait until `total` datagrams have been received in all, at most `timeout_s`.

        After a timeout the peer may have sent more than `total` in the meantime. So the next wait
        ends when no more arrive, and counts anew.
        """
        deadline_s = time.monotonic() + timeout_s
        self._drain()
        was_miscounted = self._peers.peer.is_miscounted
        while was_miscounted or self.datagrams_received < total:
            left_s = deadline_s - time.monotonic()
            wait_s = min(left_s, QUIET_S) if was_miscounted else left_s
            if wait_s <= 0 or not select.select([self._socket], [], [], wait_s)[0]:
                peer = self._peers.peer
                peer.datagrams_received, peer.is_miscounted = total, not was_miscounted
                return
            self._drain()

    def send(self, message: Message) -> None:
        peer = self._peers.peer
        if peer.address is None:
            return
        try:
            self._socket.sendto(frame(self._codec, message), peer.address)
        except OSError:
            self.messages_dropped += 1
            return
        peer.datagrams_sent += 1

    def close(self) -> None:
        self._socket.close()


class _PipeEnd:
    """One end that exchanges bytes through memory."""

    def __init__(
        self,
        inbox: deque[bytes],
        outbox: deque[bytes],
        identity: tuple[int, int],
        signing: Signing | None,
    ) -> None:
        self._inbox, self._outbox = inbox, outbox
        self._codec = make_codec(*identity, signing)

    def receive(self) -> list[Message]:
        data = b"".join(self._inbox)
        self._inbox.clear()
        return decode(self._codec, data)

    def send(self, message: Message) -> None:
        self._outbox.append(frame(self._codec, message))

    def close(self) -> None:
        self._outbox.clear()


class _DirectEnd:
    """One end that exchanges message objects, equal to those decoded from bytes."""

    def __init__(
        self, inbox: deque[Message], outbox: deque[Message], system_id: int, component_id: int
    ) -> None:
        self._inbox, self._outbox = inbox, outbox
        self._system_id, self._component_id = system_id, component_id

    def receive(self) -> list[Message]:
        messages = list(self._inbox)
        self._inbox.clear()
        return messages

    def send(self, message: Message) -> None:
        message._header.srcSystem = self._system_id
        sender = getattr(message, "sent_by", (self._component_id,))
        message._header.srcComponent = sender[0]
        _round_floats(message)
        self._outbox.append(message)

    def close(self) -> None:
        self._outbox.clear()


@dataclass(frozen=True, slots=True)
class _FloatFields:
    """Fields of a message type that are float32 on the wire."""

    singles: tuple[str, ...]
    packer: struct.Struct
    arrays: tuple[str, ...]

    @classmethod
    def of(cls, message: Message) -> "_FloatFields":
        types = zip(message.fieldnames, message.fieldtypes, strict=True)
        floats = [name for name, type_ in types if type_ == "float"]
        arrays = tuple(name for name in floats if isinstance(getattr(message, name), list | tuple))
        singles = tuple(name for name in floats if name not in arrays)
        return cls(singles, struct.Struct(f"<{len(singles)}f"), arrays)


_float_fields: dict[type, _FloatFields] = {}


def _round_floats(message: Message) -> None:
    """Round every float32 field to its value on the wire."""
    kind, fields = type(message), message.__dict__
    floats = _float_fields.get(kind) or _float_fields.setdefault(kind, _FloatFields.of(message))
    packer = floats.packer
    rounded = packer.unpack(packer.pack(*[fields[name] for name in floats.singles]))
    fields.update(zip(floats.singles, rounded, strict=True))
    for name in floats.arrays:
        array = getattr(message, name)
        setattr(
            message,
            name,
            list(struct.unpack(f"<{len(array)}f", struct.pack(f"<{len(array)}f", *array))),
        )


NO_SIGNING = (None, None)
"""Both ends without signing."""


def pipe_pair(
    system_id: int = 1, signing: tuple[Signing | None, Signing | None] = NO_SIGNING
) -> tuple[Transport, Transport]:
    """Two ends that exchange MAVLink bytes through memory: autopilot, companion."""
    to_companion: deque[bytes] = deque()
    to_autopilot: deque[bytes] = deque()
    return (
        _PipeEnd(to_autopilot, to_companion, (system_id, AUTOPILOT_COMPONENT), signing[0]),
        _PipeEnd(to_companion, to_autopilot, (system_id, COMPANION_COMPONENT), signing[1]),
    )


def direct_pair(system_id: int = 1) -> tuple[Transport, Transport]:
    """Two ends that exchange message objects: autopilot, companion."""
    to_companion: deque[Message] = deque()
    to_autopilot: deque[Message] = deque()
    return (
        _DirectEnd(to_autopilot, to_companion, system_id, AUTOPILOT_COMPONENT),
        _DirectEnd(to_companion, to_autopilot, system_id, COMPANION_COMPONENT),
    )
