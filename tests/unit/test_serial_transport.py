"""MAVLink over a serial port: a stream, cut anywhere, that may vanish and come back."""

import itertools
from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.errors import LinkError
from companion.link.serial_transport import SerialTransport
from companion.link.transport import make_codec

URL = "serial:/dev/ttyTEST:921600"


class Port:
    """Hands over what the test has put there, in the pieces in which it was put."""

    def __init__(self) -> None:
        self.pieces: deque[bytes] = deque()
        self.written = b""
        self.is_there = True

    @property
    def in_waiting(self) -> int:
        if not self.is_there:
            raise OSError(5, "Input/output error")
        return len(self.pieces[0]) if self.pieces else 0

    def read(self, count: int) -> bytes:
        return self.pieces.popleft() if self.pieces else b""

    def write(self, data: bytes) -> None:
        self.written += data

    def close(self) -> None: ...


def opened(port: Port) -> SerialTransport:
    class OnPort(SerialTransport):
        def _open(self) -> Port:
            if not port.is_there:
                raise OSError(2, "No such file or directory")
            return port

    return OnPort(URL, 1, 191)


def beats(count: int) -> bytes:
    codec = make_codec(1, 1)
    beat = mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3)
    return b"".join(beat.pack(codec) for _ in range(count))


@given(st.lists(st.integers(0, 63), max_size=6))
def test_messages_come_whole_however_the_stream_is_cut(cuts: list[int]) -> None:
    port, data = Port(), beats(3)
    transport = opened(port)
    edges = sorted({0, len(data), *cuts})
    port.pieces += [data[a:b] for a, b in itertools.pairwise(edges)]
    heard = [message for _ in edges for message in transport.receive()]
    assert [message.get_type() for message in heard] == ["HEARTBEAT"] * 3


def test_what_is_sent_is_mavlink() -> None:
    port = Port()
    opened(port).send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3))
    assert port.written[0] == 0xFD


def test_a_port_that_vanishes_is_silence_until_it_is_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_s = [10.0]
    monkeypatch.setattr("companion.link.serial_transport.time.monotonic", lambda: now_s[0])
    port = Port()
    transport = opened(port)
    port.is_there = False
    assert transport.receive() == []
    transport.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3))
    port.is_there = True
    now_s[0] += 1.5
    port.pieces.append(beats(1))
    assert len(transport.receive()) == 1


def test_a_port_that_is_not_there_at_the_start_is_refused_with_the_remedy() -> None:
    port = Port()
    port.is_there = False
    with pytest.raises(LinkError, match=r"ttyTEST.*dialout"):
        opened(port)
