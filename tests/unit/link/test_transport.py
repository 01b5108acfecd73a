"""The three transports carry the same messages."""

import math
import select
import socket
import struct
import time
from collections.abc import Iterator
from itertools import pairwise
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.errors import LinkError
from companion.link.transports import transport
from companion.link.transports.transport import Message, UdpTransport, direct_pair, pipe_pair

FLOATS = st.floats(width=32, allow_nan=False) | st.floats(-1e30, 1e30, allow_nan=False)


def carried(pair: object, message: Message) -> Message:
    autopilot, companion = pair()  # type: ignore[operator]
    autopilot.send(message)
    (received,) = companion.receive()
    return received


@given(st.lists(FLOATS, min_size=6, max_size=6), st.integers(0, 2**32 - 1))
def test_a_message_passed_directly_equals_the_decoded_message(values: list[float], ms: int) -> None:
    direct = carried(direct_pair, mavlink.MAVLink_local_position_ned_message(ms, *values))
    as_bytes = carried(pipe_pair, mavlink.MAVLink_local_position_ned_message(ms, *values))
    assert direct.to_dict() == as_bytes.to_dict()
    assert direct.get_srcSystem() == as_bytes.get_srcSystem() == 1


@given(st.lists(FLOATS, min_size=21, max_size=21))
def test_arrays_of_floats_are_rounded_to_float32(covariance: list[float]) -> None:
    def message() -> Message:
        return mavlink.MAVLink_odometry_message(
            0, 20, 12, 1.1, 2.2, 3.3, [1.0, 0.1, 0.2, 0.3], *(0.1,) * 6, covariance, covariance
        )

    assert carried(direct_pair, message()).to_dict() == carried(pipe_pair, message()).to_dict()


def test_nan_is_passed_unchanged() -> None:
    message = mavlink.MAVLink_local_position_ned_message(0, math.nan, 0, 0, 0, 0, 0)
    assert math.isnan(carried(direct_pair, message).x)


UdpPair = tuple[UdpTransport, UdpTransport]


@pytest.fixture
def udp_pair() -> Iterator[UdpPair]:
    autopilot = UdpTransport("udpin:127.0.0.1:0", 1, 1)
    companion = UdpTransport(f"udpout:127.0.0.1:{autopilot.local_port}", 1, 191)
    yield autopilot, companion
    autopilot.close()
    companion.close()


def heartbeat() -> Message:
    return mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3)


def test_udp_replies_to_the_sender(udp_pair: UdpPair) -> None:
    autopilot, companion = udp_pair
    companion.send(heartbeat())
    autopilot.await_datagrams(1, 2.0)
    assert [m.get_type() for m in autopilot.receive()] == ["HEARTBEAT"]
    autopilot.send(heartbeat())
    companion.await_datagrams(1, 2.0)
    (answer,) = companion.receive()
    assert (answer.get_srcSystem(), answer.get_srcComponent()) == (1, 1)


def test_datagrams_that_were_lost_do_not_delay_every_later_wait() -> None:
    """A simulator that sends before its companion listens, and while the companion waits."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    early = UdpTransport(f"udpout:127.0.0.1:{port}", 1, 1)
    for _ in range(30):
        early.send(heartbeat())
    companion = UdpTransport(f"udpin:127.0.0.1:{port}", 1, 191)
    for _ in range(5):
        early.send(heartbeat())
    companion.await_datagrams(30, 0.1)
    for total in (37, 39, 41):
        early.send(heartbeat())
        early.send(heartbeat())
        began_s = time.monotonic()
        companion.await_datagrams(total, 10.0)
        assert time.monotonic() - began_s < 5.0
        assert companion.datagrams_received == total
    early.close()
    companion.close()


@pytest.mark.parametrize("garbage", [b"hello", b"\xfd" * 40, b"\xfd\x09\x00\x00", b"\xfe\xff"])
def test_garbage_gives_no_message(udp_pair: UdpPair, garbage: bytes) -> None:
    autopilot, companion = udp_pair
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(garbage, ("127.0.0.1", autopilot.local_port))
    companion.send(heartbeat())
    autopilot.await_datagrams(1 + (garbage[0] >= 0xFD), 2.0)
    assert [m.get_type() for m in autopilot.receive()] == ["HEARTBEAT"]


@pytest.fixture
def now_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Clock of the transports, set by the test."""
    now = [100.0]
    monkeypatch.setattr(transport, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


@pytest.fixture
def stranger(udp_pair: UdpPair) -> Iterator[UdpTransport]:
    """Another sender to the autopilot."""
    sender = UdpTransport(f"udpout:127.0.0.1:{udp_pair[0].local_port}", 7, 1)
    yield sender
    sender.close()


def exchange(sender: UdpTransport, to: UdpTransport) -> list[Message]:
    """Send a heartbeat; returns the messages that are accepted."""
    sender.send(heartbeat())
    select.select([to._socket], [], [], 2.0)
    return to.receive()


def test_datagrams_of_another_sender_are_ignored(
    udp_pair: UdpPair, stranger: UdpTransport, now_s: list[float]
) -> None:
    autopilot, companion = udp_pair
    assert exchange(companion, autopilot)
    for _ in range(10):
        now_s[0] += 0.5
        assert not exchange(stranger, autopilot)
        assert exchange(companion, autopilot)
    assert autopilot.peer_port == companion.local_port
    assert autopilot.datagrams_received == 11


def test_a_new_sender_becomes_the_peer_while_the_peer_is_silent(
    udp_pair: UdpPair, now_s: list[float]
) -> None:
    autopilot, companion = udp_pair
    assert exchange(companion, autopilot)
    restarted = UdpTransport(f"udpout:127.0.0.1:{autopilot.local_port}", 1, 191)
    now_s[0] += 60.0  # the silence counts only from the first message of another sender
    accepted = []
    for _ in range(3):
        accepted.append(bool(exchange(restarted, autopilot)))
        now_s[0] += 1.0
    assert accepted == [False, False, True]
    assert autopilot.peer_port == restarted.local_port
    assert autopilot.datagrams_received == 1
    restarted.close()


def test_an_earlier_peer_that_sends_again_replaces_a_later_one(
    udp_pair: UdpPair, stranger: UdpTransport, now_s: list[float]
) -> None:
    autopilot, companion = udp_pair
    assert exchange(companion, autopilot)
    for _ in range(5):
        exchange(stranger, autopilot)
        now_s[0] += 1.0
    assert autopilot.peer_port == stranger.local_port
    assert exchange(companion, autopilot)
    assert not exchange(stranger, autopilot)
    assert autopilot.peer_port == companion.local_port
    assert autopilot.datagrams_received == 2


def test_a_peer_behind_strangers_in_the_queue_is_heard_after_a_long_pause(
    udp_pair: UdpPair, stranger: UdpTransport, now_s: list[float]
) -> None:
    """A process that pauses for seconds finds the strangers' messages first."""
    autopilot, companion = udp_pair
    assert exchange(companion, autopilot)
    assert not exchange(stranger, autopilot)
    now_s[0] += 10.0
    stranger.send(heartbeat())
    companion.send(heartbeat())
    autopilot.await_datagrams(2, 2.0)
    (accepted,) = autopilot.receive()
    assert accepted.get_srcComponent() == 191
    assert autopilot.peer_port == companion.local_port


@given(st.lists(st.integers(1, 200), min_size=1, max_size=8))
def test_messages_divided_between_datagrams_are_complete(cuts: list[int]) -> None:
    """Bridges from a serial port to UDP send what they have, whole messages or not."""
    codec = transport.make_codec(1, 1)
    sent = [mavlink.MAVLink_local_position_ned_message(ms, *(1.5,) * 6) for ms in range(1, 7)]
    data = b"".join(transport.frame(codec, message) for message in sent)
    ends = sorted(cut for cut in {*cuts} if data[cut] not in b"\xfd\xfe")  # as a new frame
    companion = UdpTransport("udpin:127.0.0.1:0", 1, 191)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bridge:
        for start, end in pairwise([0, *ends, len(data)]):
            bridge.sendto(data[start:end], ("127.0.0.1", companion.local_port))
        received = [message.time_boot_ms for message in companion.receive()]
    companion.close()
    assert received == [message.time_boot_ms for message in sent]


def test_a_lost_end_of_a_message_costs_no_other_message(udp_pair: UdpPair) -> None:
    autopilot, companion = udp_pair
    companion.send(heartbeat())
    autopilot.await_datagrams(1, 2.0)
    autopilot.receive()
    companion._socket.sendto(b"\xfd\x09\x00\x00", ("127.0.0.1", autopilot.local_port))
    companion.send(heartbeat())
    autopilot.await_datagrams(2, 2.0)
    assert [m.get_type() for m in autopilot.receive()] == ["HEARTBEAT"]


def test_a_closed_peer_causes_no_error(udp_pair: UdpPair) -> None:
    autopilot, companion = udp_pair
    autopilot.close()
    for _ in range(3):
        companion.send(heartbeat())
        assert companion.receive() == []


def test_a_port_in_use_is_refused_with_its_url(udp_pair: UdpPair) -> None:
    autopilot, _ = udp_pair
    url = f"udpin:127.0.0.1:{autopilot.local_port}"
    with pytest.raises(LinkError, match=url):
        UdpTransport(url, 1, 191)


@pytest.mark.parametrize(
    ("url", "remedy"),
    [
        ("udpin:192.0.2.1:14550", "no address of this computer: write 0.0.0.0"),
        ("udpout:drone..local:14550", "drone..local the right name"),
        ("udpin:127.0.0.1:99999", "a port up to 65535"),
    ],
)
def test_a_wrong_address_is_refused_with_its_remedy(url: str, remedy: str) -> None:
    with pytest.raises(LinkError, match=remedy):
        UdpTransport(url, 1, 191)


def test_values_are_received_as_float32() -> None:
    message = mavlink.MAVLink_local_position_ned_message(0, 0.1, 0, 0, 0, 0, 0)
    (rounded,) = struct.unpack("<f", struct.pack("<f", 0.1))
    assert carried(direct_pair, message).x == rounded


def test_a_field_named_id_does_not_hide_the_message_type() -> None:
    vehicle_end, end = pipe_pair()
    vehicle_end.send(mavlink.MAVLink_distance_sensor_message(0, 2, 500, 150, 2, 10, 0, 0))
    assert [m.get_type() for m in end.receive()] == ["DISTANCE_SENSOR"]
