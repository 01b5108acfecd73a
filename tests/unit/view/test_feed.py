"""Tests the feed: snapshots reach authorized viewers only, and never delay the flight."""

import math
import socket
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Queue
from threading import Thread

import pytest

from companion.app import App
from companion.config.settings import Config, MissionConfig, load
from companion.config.view import ViewConfig
from companion.core.errors import ConfigError, ViewError
from companion.core.messages import (
    Beam,
    Pose,
    RangeReading,
    RangeScan,
    RangeState,
    Sketch,
    VehicleState,
    WallSegment,
)
from companion.link.link import Telemetry
from companion.pdps.flight.state import FlightState
from companion.ticks import Inputs, Outputs, Progress
from companion.view.feed import NoFeed, TcpFeed, open_feed
from companion.view.feed_client import FeedClient, parse_address
from companion.view.snapshot import Snapshot, decode, encode
from tests.processes.started import free_tcp_port
from tests.unit.team.rooms import Member
from tests.unit.team.rooms import config as team_config
from tests.waiting import DEADLINE_S, PAUSE

TOKEN = "0123456789abcdef"
WALL = WallSegment((0.0, 1.0), (2.0, 1.0), 0.02, 40, 0.01)
INPUTS = Inputs(Telemetry(VehicleState()), [], RangeScan(0.0, {}))


class Mapping(App):
    """An app that has mapped a wall."""

    def sketch(self) -> Sketch:
        return Sketch((WALL,), ((0.0, 1.0, -1.2),), ((0.0, 0.0, 0.0),), 2.5)


def outputs(time_s: float) -> Outputs:
    reading = RangeReading(RangeState.DISTANCE, 1.5, 0.01)
    scan = RangeScan(time_s, {Beam.FRONT: reading, Beam.UP: RangeReading(RangeState.NOTHING)})
    pose = Pose(time_s, 1.0, 2.0, -1.2, 0.5)
    return Outputs(None, None, pose, Progress(time_s, "", "", tuple), FlightState(), scan)


def fail(warning: str) -> None:
    raise AssertionError(warning)


@pytest.fixture
def feed() -> Iterator[TcpFeed]:
    feed = TcpFeed(("127.0.0.1", 0), TOKEN, Mapping(Config()), Config(), fail)
    yield feed
    feed.close()


def tick_until(feed: TcpFeed, is_done: Callable[[], bool], first_s: float = 0.0) -> float:
    """Tick the feed until `is_done`; return the flight's time, s."""
    for number in range(20 * DEADLINE_S):
        if is_done():
            return first_s + number * 0.05
        feed.tick(first_s + number * 0.05, INPUTS, outputs(first_s + number * 0.05))
        PAUSE.wait(0.02)
    raise AssertionError("not within the deadline")


def test_a_viewer_receives_map_and_pose(feed: TcpFeed) -> None:
    seen: Queue[Snapshot] = Queue()
    viewer = FeedClient(("127.0.0.1", feed.port), TOKEN, seen.put, lambda reason: None)
    tick_until(feed, lambda: seen.qsize() > 3)
    first = seen.get(timeout=DEADLINE_S)
    assert first.sketch == Mapping(Config()).sketch()
    assert first.pose is not None
    assert first.pose.north_m == 1.0
    assert first.readings[Beam.FRONT].distance_m == 1.5
    assert first.readings[Beam.UP].state is RangeState.NOTHING
    assert first.mount_offset_m == 0.08
    viewer.close()


def test_a_viewer_receives_the_teammates_in_the_frame_of_the_map() -> None:
    """The second drone stands at 1 m north, 0.5 m east of the first, and looks east."""
    config = Config(team=team_config(1), mission=MissionConfig(kind="building"))
    app = Mapping(config)
    assert app.team is not None
    listener, teller = Member(1, 0), Member(2, 0)
    packets = teller.tell(0.0)
    app.team.mates.hear(0.0, packets, lambda: listener.walls, listener.grid.grid)
    feed = TcpFeed(("127.0.0.1", 0), TOKEN, app, config, fail)
    seen: Queue[Snapshot] = Queue()
    viewer = FeedClient(("127.0.0.1", feed.port), TOKEN, seen.put, lambda reason: None)
    tick_until(feed, lambda: not seen.empty())
    first = seen.get(timeout=DEADLINE_S)
    [mate] = first.mates
    assert (first.drone, mate.drone) == (1, 2)
    assert mate.ne_m == pytest.approx((1.0, 0.5))
    assert mate.yaw_rad == pytest.approx(0.5 * math.pi)
    assert (mate.phase, mate.battery) == ("exploring", 0.8)
    viewer.close()
    feed.close()


def test_a_late_viewer_receives_the_map_at_once(feed: TcpFeed) -> None:
    early: Queue[Snapshot] = Queue()
    late: Queue[Snapshot] = Queue()
    first = FeedClient(("127.0.0.1", feed.port), TOKEN, early.put, lambda reason: None)
    time_s = tick_until(feed, lambda: early.qsize() > 1)
    second = FeedClient(("127.0.0.1", feed.port), TOKEN, late.put, lambda reason: None)
    tick_until(feed, lambda: not late.empty(), time_s)
    assert late.get(timeout=DEADLINE_S).sketch is not None
    first.close()
    second.close()


def test_a_viewer_with_a_wrong_token_receives_nothing(feed: TcpFeed) -> None:
    seen: list[Snapshot] = []
    complaints: Queue[str] = Queue()
    viewer = FeedClient(("127.0.0.1", feed.port), "wrong", seen.append, complaints.put)
    tick_until(feed, lambda: not complaints.empty())
    assert "--drone-token-file" in complaints.get(timeout=DEADLINE_S)
    assert not seen
    viewer.close()


def test_a_client_that_sends_nothing_or_garbage_does_not_block_the_feed(feed: TcpFeed) -> None:
    silent = socket.create_connection(("127.0.0.1", feed.port), DEADLINE_S)
    babbling = socket.create_connection(("127.0.0.1", feed.port), DEADLINE_S)
    babbling.sendall(b"GET / HTTP/1.1\r\nHost: drone\r\n\r\n" + b"x" * 1000)
    seen: Queue[Snapshot] = Queue()
    viewer = FeedClient(("127.0.0.1", feed.port), TOKEN, seen.put, lambda reason: None)
    tick_until(feed, lambda: seen.qsize() > 1)
    for other in (viewer, silent, babbling):
        other.close()


def test_no_sketch_is_made_without_a_viewer(feed: TcpFeed) -> None:
    class Untouched(App):
        def sketch(self) -> Sketch:
            raise AssertionError("nobody looks")

    quiet = TcpFeed(("127.0.0.1", 0), TOKEN, Untouched(Config()), Config(), fail)
    quiet.tick(1.0, INPUTS, outputs(1.0))
    quiet.close()


def test_an_error_ends_the_feed_and_not_the_flight() -> None:
    class Broken(App):
        def sketch(self) -> Sketch:
            raise ZeroDivisionError

    warnings: list[str] = []
    feed = TcpFeed(("127.0.0.1", 0), TOKEN, Broken(Config()), Config(), warnings.append)
    viewer = FeedClient(("127.0.0.1", feed.port), TOKEN, lambda seen: None, lambda reason: None)
    tick_until(feed, lambda: bool(warnings))
    assert "ZeroDivisionError" in warnings[0]
    viewer.close()


def test_a_snapshot_is_unchanged_after_encoding_and_decoding() -> None:
    snapshot = Snapshot(
        1.0, "scanning", pose=Pose(1.0, 0.1, 0.2, -1.0, 0.3), sketch=Sketch((WALL,))
    )
    assert decode(encode(snapshot)) == snapshot


def test_the_feed_is_off_by_default() -> None:
    assert isinstance(open_feed(Config(), App(Config()), fail), NoFeed)


def test_an_address_that_others_reach_needs_a_token() -> None:
    config = Config(view=ViewConfig(listen="0.0.0.0:0"))
    with pytest.raises(ViewError, match=r"view.listen = '0.0.0.0:0'.*view.token_file"):
        open_feed(config, App(config), fail)


def test_a_port_in_use_is_reported(feed: TcpFeed) -> None:
    config = Config(view=ViewConfig(listen=f"127.0.0.1:{feed.port}"))
    with pytest.raises(ViewError, match=r"view.listen = .*Address already in use"):
        open_feed(config, App(config), fail)


def test_addresses_of_drones_are_parsed() -> None:
    assert parse_address("drone.local") == ("drone.local", 5795)
    assert parse_address("10.0.0.7:99") == ("10.0.0.7", 99)
    with pytest.raises(ViewError, match="HOST:PORT"):
        parse_address("drone:port")
    with pytest.raises(ViewError, match=r"view\.listen"):
        FeedClient(("127.0.0.1", free_tcp_port()), "", lambda seen: None, lambda reason: None)


def test_a_snapshot_of_excessive_length_is_not_read() -> None:
    listener = socket.create_server(("127.0.0.1", 0))
    complaints: Queue[str] = Queue()

    def lie() -> None:
        drone, _ = listener.accept()
        with drone:
            drone.sendall(b"PDPS view 1\n" + bytes(16) + struct.pack(">I", 1 << 31))
            drone.recv(64)

    Thread(target=lie, daemon=True).start()
    port = listener.getsockname()[1]
    viewer = FeedClient(("127.0.0.1", port), "", lambda seen: None, complaints.put)
    assert "2147483648 bytes" in complaints.get(timeout=DEADLINE_S)
    viewer.close()
    listener.close()


def test_a_bad_address_in_the_configuration_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "drone.toml"
    file.write_text('[view]\nlisten = "5795"\n')
    with pytest.raises(ConfigError, match=r"view.listen = '5795'"):
        load(file)
