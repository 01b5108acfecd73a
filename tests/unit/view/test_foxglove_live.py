"""Tests the Foxglove stream: it is the recording, live, and never delays or ends the flight."""

import json
import socket
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader
from typer.testing import CliRunner

from companion.commands.options import Foxglove, WithFoxglove
from companion.config.settings import Config, load
from companion.config.view import ViewConfig
from companion.core.errors import ConfigError, MissingExtraError, ViewError
from companion.core.messages import (
    FloorPlan,
    WallSegment,
)
from companion.recording import topics
from companion.recording.recorder import NOT_RECORDED, open_recorder
from companion.view.foxglove_live import LAYOUT, publish_too
from companion.view.foxglove_server import TopicServer
from tests.standing_flight import CONFIG, DESCRIBED, TICK_S, WALL, StandingFlight
from tests.waiting import until


def no_walls() -> tuple[WallSegment, ...]:
    raise AssertionError("nobody receives walls")


def broken() -> tuple[WallSegment, ...]:
    raise ZeroDivisionError


@pytest.fixture
def warnings() -> list[str]:
    return []


@pytest.fixture
def flight(warnings: list[str]) -> Iterator[StandingFlight]:
    flight = StandingFlight(warnings)
    yield flight
    flight.server.close()


def test_a_client_receives_walls_and_pose_in_flight(flight: StandingFlight) -> None:
    for _ in range(100):
        flight.tick(no_walls)
    with flight.client(topics.WALLS, topics.POSE, topics.TF) as client:
        for _ in range(20):
            flight.tick()
        scene = SceneUpdate.FromString(client.next_of(topics.WALLS).data)
        received = client.next_of(topics.POSE)
        transform = FrameTransform.FromString(client.next_of(topics.TF).data)
        client.await_time(received.time_s)
    (cube,) = scene.entities[0].cubes
    assert (cube.pose.position.x, cube.pose.position.y) == (1.0, 1.0)  # ENU
    assert cube.size.x == 2.0
    pose = Odometry.FromString(received.data)
    assert (pose.pose.position.x, pose.pose.position.y, pose.pose.position.z) == (2.0, 1.0, 1.2)
    assert received.time_s >= 5.0
    assert (transform.parent_frame_id, transform.child_frame_id) == ("map", "base_link")


def test_the_stream_has_the_messages_and_schemas_of_the_recording(
    tmp_path: Path, warnings: list[str]
) -> None:
    """Except for the walls, which it has more often."""
    flight = StandingFlight(warnings, open_recorder(tmp_path, CONFIG, 0.0, warnings.append))
    with flight.client() as client:
        for _ in range(60):
            flight.tick()
        flight.live.close(FloorPlan((WALL,)))
        streamed = defaultdict(list)
        for message in client.messages():
            streamed[message.topic].append((message.time_s, message.data))
    (mcap,) = tmp_path.glob("*.mcap")
    recorded = defaultdict(list)
    with mcap.open("rb") as file:
        for schema, channel, written in make_reader(file).iter_messages():
            if schema is not None:
                assert client.channels[channel.topic]["schemaName"] == schema.name
                assert client.channels[channel.topic]["encoding"] == channel.message_encoding
                recorded[channel.topic].append((written.log_time / 1e9, written.data))
    walls = streamed.pop(topics.WALLS), recorded.pop(topics.WALLS)
    assert len(walls[0]) > 2
    assert walls[0][-1] == walls[1][-1]
    assert streamed == recorded
    assert {topics.RANGES, topics.PHASE, topics.VEHICLE, topics.CONFIG, topics.AUTOPILOT} <= set(
        streamed
    )
    assert not warnings


def test_a_late_client_receives_map_and_configuration_at_once(flight: StandingFlight) -> None:
    with flight.client(topics.WALLS) as first:
        flight.tick()
        assert first.next_of(topics.WALLS).time_s == 0.0
        with flight.client(topics.WALLS, topics.CONFIG) as late:
            flight.tick()
            assert late.next_of(topics.CONFIG).data == CONFIG.model_dump_json().encode()
            assert late.next_of(topics.WALLS).time_s == pytest.approx(TICK_S)


def test_the_last_message_is_the_final_map(flight: StandingFlight) -> None:
    with flight.client(topics.WALLS) as client:
        flight.tick()
        flight.live.close(FloorPlan((WALL, WALL), ceiling_m=2.4))
        *_, last = client.messages()
    scene = SceneUpdate.FromString(last.data)
    assert [cube.size.z for cube in scene.entities[0].cubes] == [2.4, 2.4]


def test_nothing_is_computed_without_a_client(flight: StandingFlight) -> None:
    for _ in range(100):
        flight.tick(no_walls)


def test_a_client_that_reads_nothing_delays_neither_the_flight_nor_other_clients(
    flight: StandingFlight,
) -> None:
    with flight.client(most_unread=1), flight.client(topics.POSE) as client:
        while flight.time_s < 120:
            for _ in range(200):
                flight.tick()
            while client.next_of(topics.POSE).time_s < flight.time_s - 0.3:
                continue


def test_a_lost_client_prints_nothing(
    flight: StandingFlight, caplog: pytest.LogCaptureFixture
) -> None:
    """The terminal belongs to the flight; the server has a line for each message not received."""
    with flight.client(most_unread=1) as client:
        for _ in range(100):
            flight.tick()
        client.connection.socket.shutdown(socket.SHUT_RDWR)
        until(lambda: not flight.server.has_clients, "the loss")
    assert not [record for record in caplog.records if record.name.startswith("foxglove")]


def test_an_error_ends_the_stream_and_not_the_flight(
    flight: StandingFlight, warnings: list[str]
) -> None:
    with flight.client(topics.WALLS):
        flight.tick(broken)
        flight.tick(broken)
    flight.live.close(FloorPlan())
    (warning,) = warnings
    assert "ZeroDivisionError" in warning


def test_there_is_no_stream_by_default() -> None:
    assert publish_too(NOT_RECORDED, Config(), pytest.fail) is NOT_RECORDED


def test_a_missing_extra_is_reported_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "foxglove", None)
    monkeypatch.delitem(sys.modules, "companion.view.foxglove_server")
    with pytest.raises(MissingExtraError, match=r"pip install 'pdps-companion\[foxglove\]'"):
        publish_too(NOT_RECORDED, CONFIG, pytest.fail)


def test_the_address_and_the_layout_are_reported(warnings: list[str]) -> None:
    live = publish_too(NOT_RECORDED, CONFIG, warnings.append)
    live.close(FloorPlan())
    (said,) = warnings
    assert said.startswith("Foxglove: ws://127.0.0.1:")
    assert str(LAYOUT) in said


def test_an_address_that_others_reach_must_be_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ViewError, match=r"view.foxglove = '0.0.0.0:0'.*ssh.*view.foxglove_open"):
        TopicServer(ViewConfig(foxglove="0.0.0.0:0"))
    monkeypatch.setattr("companion.view.foxglove_server.is_loopback", lambda host: False)
    TopicServer(ViewConfig(foxglove="127.0.0.1:0", foxglove_open=True)).close()


@pytest.mark.parametrize(
    ("address", "reason"), [("127.0.0.1:{port}", "in use"), ("127.0.0.1:99999", "another port")]
)
def test_an_unusable_address_is_reported(flight: StandingFlight, address: str, reason: str) -> None:
    with pytest.raises(ViewError, match=rf"view.foxglove = '127.0.0.1:\d+': .*{reason}"):
        TopicServer(ViewConfig(foxglove=address.format(port=flight.server.port)))


def test_a_bad_address_in_the_configuration_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "drone.toml"
    file.write_text('[view]\nfoxglove = "8765"\n')
    with pytest.raises(ConfigError, match=r"view.foxglove = '8765'"):
        load(file)


@pytest.mark.parametrize(
    ("arguments", "address"),
    [
        ((), "None"),
        (("--foxglove",), "127.0.0.1:8765"),
        (("--foxglove", "office"), "127.0.0.1:8765 office"),
        (("--foxglove", "--foxglove", "10.0.0.7:99"), "10.0.0.7:99"),
        (("office", "--foxglove=10.0.0.7:99"), "10.0.0.7:99 office"),
    ],
)
def test_the_address_may_be_left_out(arguments: tuple[str, ...], address: str) -> None:
    commands = typer.Typer()

    @commands.command(cls=WithFoxglove)
    def fly(world: str = typer.Argument(""), foxglove: Foxglove = None) -> None:
        typer.echo(f"{foxglove} {world}".strip())

    assert CliRunner().invoke(commands, list(arguments)).output.strip() == address


def test_the_layout_shows_only_what_is_published() -> None:
    layout = json.loads(LAYOUT.read_text(encoding="utf-8"))
    shown = set(shown_paths(layout["configById"]))
    assert {topics.WALLS, topics.POSE, topics.SCAN, topics.FAULTS} <= shown
    for path in shown:
        topic, *fields = path.split(".")
        schema = json.loads(DESCRIBED[topic].schema) if fields else {}
        for field in fields:
            schema = schema["properties"][field]
    assert set(panels(layout["layout"])) == set(layout["configById"])


def shown_paths(configs: dict[str, dict[str, object]]) -> Iterator[str]:
    """Topics, and fields of topics, that the panels of a layout show."""
    for config in configs.values():
        yield from config.get("topics", {})  # type: ignore[misc]
        yield from (series["value"] for series in config.get("paths", ()))  # type: ignore[attr-defined]
        if "topicToRender" in config:
            yield str(config["topicToRender"])


def panels(node: object) -> Iterator[str]:
    """Names of the panels in a tree of splits."""
    if isinstance(node, dict):
        yield from panels(node["first"])
        yield from panels(node["second"])
    else:
        yield str(node)
