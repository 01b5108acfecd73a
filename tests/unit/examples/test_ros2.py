"""The example for ROS 2: bag, live messages and Zenoh show the flight in the frames of REP 105."""

import json
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
import zenoh
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from companion.core.messages import FloorPlan
from companion.recording.recorder import open_recorder
from tests.processes.started import free_tcp_port
from tests.standing_flight import CONFIG, WALL, StandingFlight
from tests.waiting import DEADLINE_S, until

EXAMPLE = Path(__file__).parents[3] / "examples" / "ros2"
STORE = get_typestore(Stores.ROS2_JAZZY)
BEGAN_UNIX_S = 1_800_000_000.0


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.syspath_prepend(EXAMPLE)
    yield
    for name in ("pdps_ros2", "to_bag", "stream", "over_zenoh"):
        sys.modules.pop(name, None)


def check_map(grid: Any) -> None:
    """The wall is 1 m east of the start, from 0 to 2 m north; beams freed cells, few were seen."""
    assert grid.header.frame_id == "map"
    cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    rows, columns = np.nonzero(cells == 100)
    x_m = grid.info.origin.position.x + grid.info.resolution * (columns + 0.5)
    y_m = grid.info.origin.position.y + grid.info.resolution * (rows + 0.5)
    assert x_m == pytest.approx(np.full(len(x_m), 1.0), abs=0.051)
    assert (y_m.min(), y_m.max()) == (pytest.approx(0, abs=0.06), pytest.approx(2, abs=0.06))
    assert np.count_nonzero(cells == 0) > 10
    assert np.count_nonzero(cells == -1) > 10


def check_pose(odometry: Any) -> None:
    """The pose is 1 m north, 2 m east, 1.2 m high."""
    at = odometry.pose.pose.position
    assert (at.x, at.y, at.z) == (2.0, 1.0, 1.2)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")


def test_a_recording_becomes_a_bag(example: None, tmp_path: Path) -> None:
    flight = StandingFlight([], open_recorder(tmp_path, CONFIG, BEGAN_UNIX_S, pytest.fail))
    for _ in range(40):
        flight.tick()
    flight.live.close(FloorPlan((WALL,)))
    (recording,) = tmp_path.glob("*.mcap")
    import_module("to_bag").write_bag(recording, tmp_path / "bag")
    last: dict[str, Any] = {}
    with Reader(tmp_path / "bag") as reader:
        for connection, time_ns, data in reader.messages():
            assert BEGAN_UNIX_S <= time_ns / 1e9 < BEGAN_UNIX_S + 3
            last[connection.topic] = STORE.deserialize_cdr(bytes(data), connection.msgtype)
    check_map(last["/map"])
    check_pose(last["/odom"])
    scan = last["/scan"]
    assert scan.angle_min + scan.angle_increment == pytest.approx(0)  # the front
    assert scan.ranges[1] == pytest.approx(1.58)
    frames = [
        (each.header.frame_id, each.child_frame_id)
        for topic in ("/tf_static", "/tf")
        for each in last[topic].transforms
    ]
    assert frames == [("map", "odom"), ("odom", "base_link")]


def fly(flight: StandingFlight, receive: Callable[[], object]) -> None:
    """Fly while `receive` runs in a thread of its own, until it ends with the stream."""
    program = Thread(target=receive)
    program.start()
    needed = import_module("pdps_ros2").NEEDED
    until(lambda: all(map(flight.server.is_received, needed)), "the subscriptions")
    for _ in range(40):
        flight.tick()
    flight.live.close(FloorPlan((WALL,)))
    program.join(DEADLINE_S)


def test_the_live_stream_becomes_messages(example: None) -> None:
    """As lists, which the messages of rclpy take."""
    stream, example_module = import_module("stream"), import_module("pdps_ros2")
    flight = StandingFlight([])
    messages = example_module.Messages(STORE.types.get, lambda values: values.tolist())
    last: dict[str, Any] = {}
    received = stream.received(flight.server.url, messages)
    fly(flight, lambda: last.update((each.topic, each) for each in received))
    assert last.keys() == example_module.TYPES.keys()
    check_map(last["/map"].message)
    check_pose(last["/odom"].message)
    assert isinstance(last["/scan"].message.ranges, list)
    assert abs(last["/scan"].time_ns / 1e9 - time.time()) < 60


def test_keys_are_those_of_rmw_zenoh(example: None) -> None:
    """The example of its design document, with the type's hash from rosbags."""
    key = import_module("over_zenoh").key_of("/chatter", "std_msgs/msg/String", 0)
    assert key == (
        "0/chatter/std_msgs::msg::dds_::String_/"
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    )


def test_the_live_stream_is_published_over_zenoh(example: None) -> None:
    over_zenoh = import_module("over_zenoh")
    router = f"tcp/127.0.0.1:{free_tcp_port()}"
    config = zenoh.Config()
    config.insert_json5("listen/endpoints", json.dumps([router]))
    config.insert_json5("scouting/multicast/enabled", "false")
    last: dict[str, Any] = {}
    nodes: set[str] = set()
    flight = StandingFlight([])
    with zenoh.open(config) as session:
        session.declare_subscriber(
            "3/**", lambda sample: last.update({str(sample.key_expr): sample})
        )
        session.liveliness().declare_subscriber(
            "@ros2_lv/3/**", lambda token: nodes.add(str(token.key_expr).split("/")[5])
        )
        fly(flight, lambda: over_zenoh.publish(flight.server.url, router, 3))
        until(lambda: len(last) == len(over_zenoh.TYPES), "all topics")
    assert nodes == {"NN", "MP"}
    by_topic = {key.split("/")[1]: sample for key, sample in last.items()}
    check_map(decoded(by_topic["map"], "nav_msgs/msg/OccupancyGrid"))
    check_pose(decoded(by_topic["odom"], "nav_msgs/msg/Odometry"))
    number, sent_ns, length, _ = over_zenoh.ATTACHMENT.unpack(bytes(by_topic["odom"].attachment))
    assert (number, length) == (10, 16)
    assert abs(sent_ns / 1e9 - time.time()) < 60


def decoded(sample: Any, name: str) -> Any:
    return STORE.deserialize_cdr(bytes(sample.payload), name)
