"""MAVLink over a serial port: fragments of a stream, and a port that is unplugged."""

import itertools
import os
import pty
import time
import tty
from collections import deque
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.core.errors import LinkError
from companion.core.messages import HOLD, Pose
from companion.link.link import Link
from companion.link.transports.serial_line import MAX_BACKLOG_S, SerialLine
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import decode_stream, make_codec

URL = "serial:/dev/ttyTEST:921600"


class Port:
    """Returns the bytes that the test supplies, in the same pieces.

    Written bytes go into a buffer of 4096 bytes, as in the kernel, which a UART empties at
    `bytes_per_s`. `at_once` is the maximum number of bytes that one write accepts.
    `reports_backlog`: the driver reports its backlog.
    """

    def __init__(
        self, bytes_per_s: float = 1e9, at_once: int = 4096, *, reports_backlog: bool = True
    ) -> None:
        self.pieces: deque[bytes] = deque()
        self.written = b""
        self.left_at_s: list[float] = []
        """Time at which each written byte was sent, s."""
        self.is_there = True
        self.now_s = 0.0
        self.bytes_per_s = bytes_per_s
        self._at_once, self._reports_backlog = at_once, reports_backlog
        self._queued = self._drained_at_s = 0.0

    @property
    def in_waiting(self) -> int:
        if not self.is_there:
            raise OSError(5, "Input/output error")
        return len(self.pieces[0]) if self.pieces else 0

    @property
    def out_waiting(self) -> int:
        self._drain()
        return int(self._queued) if self._reports_backlog else 0

    def _drain(self) -> None:
        self._queued -= min(self._queued, self.bytes_per_s * (self.now_s - self._drained_at_s))
        self._drained_at_s = self.now_s

    def read(self, size: int = 1) -> bytes:
        return self.pieces.popleft() if self.pieces else b""

    def write(self, data: bytes) -> int:
        self._drain()
        taken = min(len(data), self._at_once, int(4096 - self._queued))
        self.written += data[:taken]
        for _ in range(taken):
            self._queued += 1
            rate = self.bytes_per_s or 1e-9
            self.left_at_s.append(self.now_s + self._queued / rate)
        return taken

    def takes(self, at_once: int) -> None:
        """Accept only `at_once` more bytes in all."""
        self._queued, self.bytes_per_s, self._drained_at_s = 4096.0 - at_once, 0.0, self.now_s

    def close(self) -> None: ...


def opened(port: Port, url: str = URL) -> SerialTransport:
    class OnPort(SerialTransport):
        def _open(self) -> Port:
            if not port.is_there:
                raise OSError(2, "No such file or directory")
            return port

    return OnPort(url, 1, 191)


def beats(count: int) -> bytes:
    codec = make_codec(1, 1)
    beat = mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3)
    return b"".join(beat.pack(codec) for _ in range(count))


@given(st.lists(st.integers(0, 63), max_size=6))
def test_messages_are_decoded_from_any_fragments_of_the_stream(cuts: list[int]) -> None:
    port, data = Port(), beats(3)
    transport = opened(port)
    edges = sorted({0, len(data), *cuts})
    port.pieces += [data[a:b] for a, b in itertools.pairwise(edges)]
    received = [message for _ in edges for message in transport.receive()]
    assert [message.get_type() for message in received] == ["HEARTBEAT"] * 3


def test_a_sent_message_is_a_mavlink_2_frame() -> None:
    port = Port()
    opened(port).send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3))
    assert port.written[0] == 0xFD


def test_a_removed_port_gives_no_messages_until_it_returns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_s = [10.0]
    monkeypatch.setattr(
        "companion.link.transports.serial_transport.time.monotonic", lambda: now_s[0]
    )
    port = Port()
    transport = opened(port)
    port.is_there = False
    assert transport.receive() == []
    transport.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3))
    port.is_there = True
    now_s[0] += 1.5
    port.pieces.append(beats(1))
    assert len(transport.receive()) == 1


def test_a_port_missing_at_start_is_refused_with_the_remedy() -> None:
    port = Port()
    port.is_there = False
    with pytest.raises(LinkError, match=r"ttyTEST.*dialout"):
        opened(port)


def test_a_port_is_opened_by_its_path_which_may_contain_colons(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    by_path = "/dev/serial/by-path/platform-fd500000.pcie-pci-0000:01:00.0-usb-0:1.2:1.0-port0"
    config = LinkConfig(url=f"serial:{by_path}:57600")
    asked: list[tuple[str, int]] = []

    def open_(path: str, baud: int) -> Port:
        asked.append((path, baud))
        return Port()

    monkeypatch.setattr("companion.link.transports.uart.Uart", open_)
    SerialTransport(config.url, 1, 191)
    assert asked == [(config.serial_port, 57600)] == [(by_path, 57600)]


# A port that accepts no bytes, or too few

TICK_S = 0.05


def flown(port: Port, monkeypatch: pytest.MonkeyPatch, baud: int, ticks: int = 200) -> list[float]:
    """Age of each setpoint when it is completely sent, s; poses are sent as well."""
    now_s = [0.0]
    monkeypatch.setattr(
        "companion.link.transports.serial_transport.time.monotonic", lambda: now_s[0]
    )
    transport = opened(port, f"serial:/dev/ttyTEST:{baud}")
    link = Link(transport, LinkConfig(send_pose=True))
    codec = make_codec(1, 1)
    attitude = mavlink.MAVLink_attitude_message(100, 0, 0, 0, 0, 0, 0)
    beat = mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3)
    port.pieces += [beat.pack(codec), attitude.pack(codec)]
    for tick in range(ticks):
        port.now_s = now_s[0] = tick * TICK_S
        link.poll(now_s[0])
        link.send(now_s[0], HOLD, None, Pose(now_s[0], 1.0, 0.0, 0.0, 0.0))
    return ages_s(port)


def ages_s(port: Port) -> list[float]:
    parser, ages = make_codec(255, 1), []
    for byte, left_s in zip(port.written, port.left_at_s, strict=True):
        for message in decode_stream(parser, bytes([byte])):
            if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
                ages.append(left_s - message.time_boot_ms * 1e-3)
    return ages


@pytest.mark.parametrize("reports_backlog", [True, False])
@pytest.mark.parametrize("at_once", [4096, 100, 7])
@pytest.mark.parametrize("baud", [38400, 57600, 115200, 921600])
def test_a_slow_port_receives_complete_and_recent_setpoints(
    monkeypatch: pytest.MonkeyPatch, baud: int, at_once: int, reports_backlog: bool
) -> None:
    """The messages exceed 57600 baud: poses are dropped, setpoints are sent."""
    ages = flown(Port(baud / 10, at_once, reports_backlog=reports_backlog), monkeypatch, baud)
    assert len(ages) >= 198
    assert max(ages) < MAX_BACKLOG_S + 0.02


def test_heartbeats_are_in_time_among_setpoints(monkeypatch: pytest.MonkeyPatch) -> None:
    port = Port(5760.0)
    flown(port, monkeypatch, 57600)
    beats = [
        m for m in decode_stream(make_codec(255, 1), port.written) if m.get_type() == "HEARTBEAT"
    ]
    assert len(beats) == 10


@pytest.mark.parametrize("reports_backlog", [True, False])
def test_a_port_that_accepts_no_bytes_does_not_block(
    monkeypatch: pytest.MonkeyPatch, reports_backlog: bool
) -> None:
    port = Port(0.0, reports_backlog=reports_backlog)
    flown(port, monkeypatch, 57600, ticks=2000)
    assert len(port.written) <= 4096


def test_the_backlog_of_a_blocked_port_is_bounded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    port = Port(0.0)
    flown(port, monkeypatch, 57600, ticks=200)
    assert len(port.written) / 5760 <= MAX_BACKLOG_S + 0.02


def test_an_incomplete_message_that_is_too_old_is_invalidated() -> None:
    """An incomplete message would corrupt the next. A completed old message would seem new."""
    port = Port(reports_backlog=False)
    line = SerialLine(port, 57600)
    old, new = beats(1), beats(1)
    port.takes(10)
    assert line.send(old, 0.0, is_urgent=True)
    port.takes(0)
    assert not line.send(new, 0.05, is_urgent=True)
    port.takes(4096)
    assert line.send(new, 5.0, is_urgent=True)
    assert len(decode_stream(make_codec(255, 1), port.written)) == 1


def test_dropped_messages_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    port = Port(0.0)
    transport = opened(port, "serial:/dev/ttyTEST:57600")
    for _ in range(300):
        transport.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3))
    assert transport.messages_sent + transport.messages_dropped == 300
    assert transport.messages_dropped > 250


@pytest.fixture
def terminal() -> Iterator[str]:
    """A real port whose other end is not read."""
    master, slave = pty.openpty()
    tty.setraw(master)
    yield os.ttyname(slave)
    os.close(slave)
    os.close(master)


def test_a_real_port_whose_other_end_is_not_read_does_not_block(terminal: str) -> None:
    transport = SerialTransport(f"serial:{terminal}:921600", 1, 191)
    began_s = time.monotonic()
    while transport.messages_dropped < 1000:
        transport.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3))
        assert time.monotonic() - began_s < 20
    transport.close()
    assert time.monotonic() - began_s < 20
