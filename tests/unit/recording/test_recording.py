"""Recorded flights: other programs open them, replay is exact, and faults do not end a flight."""

import dataclasses
import errno
import json
import math
import os
from collections import Counter
from contextlib import suppress
from itertools import groupby
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config import settings as configuration
from companion.config.settings import Config
from companion.config.team import PadConfig, TeamConfig
from companion.core.errors import RecordingError
from companion.core.frames import wrap_rad, yaw_ned_to_enu
from companion.core.messages import (
    Beam,
    FloorPlan,
    GyroSample,
    Odometry,
    RangeReading,
    RangeScan,
    RangeState,
    Setpoint,
    VehicleState,
)
from companion.link.link import Telemetry
from companion.link.transports.transport import pipe_pair
from companion.pdps.flight.order import Order, Target, Task
from companion.recording import topics
from companion.recording.exact import Tick, decode_ticks, encode_plan, encode_ticks
from companion.recording.reader import read
from companion.recording.recorder import FlightRecorder, open_recorder
from companion.recording.replay import is_same_map, replay
from companion.recording.tlog import Tap
from companion.ticks import Inputs, Progress
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.simulation import Setup
from sitl.testing import Flight, Sitl, at, crash, link_down, unplug, when
from sitl.world.loading import load_world
from tests.examples import examples
from tests.worlds import SMALL_ROOM

pytestmark = pytest.mark.flights

ANY = st.floats()
BEGIN_BYTES = 200
"""Magic, header, and type of the recording."""
END_BYTES = 9
NUMBERS = st.tuples(ANY, ANY, ANY)
READINGS = st.builds(RangeReading, st.sampled_from(RangeState), ANY, ANY)
ORDERS = st.builds(
    Order,
    st.integers(0, 2**31),
    st.sampled_from(Task),
    st.text(),
    st.none() | st.builds(Target, st.tuples(ANY, ANY), st.none() | ANY, st.none() | ANY),
    st.builds(Setpoint, ANY, ANY, ANY, ANY),
    ANY,
    st.booleans(),
)
TICKS = st.builds(
    Tick,
    ANY,
    st.builds(
        Inputs,
        st.builds(
            Telemetry,
            st.builds(VehicleState, st.booleans(), ANY, st.text()),
            st.none() | st.builds(Odometry, ANY, NUMBERS, NUMBERS, ANY),
            st.lists(st.text(), max_size=2).map(tuple),
        ),
        st.lists(st.builds(GyroSample, ANY, ANY), max_size=7),
        st.builds(RangeScan, ANY, st.dictionaries(st.sampled_from(Beam), READINGS)),
        st.booleans(),
        st.none() | ORDERS,
    ),
)


@dataclasses.dataclass(frozen=True)
class Recorded:
    """A flight and its files."""

    flight: Flight
    mcap: Path

    @property
    def tlog(self) -> Path:
        return self.mcap.with_suffix(".tlog")


def recorded(folder: Path, **options: object) -> Recorded:
    flight = Sitl(folder).fly(SMALL_ROOM, record=folder, **options)  # type: ignore[arg-type]
    (mcap,) = folder.glob("*.mcap")
    return Recorded(flight, mcap)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded(tmp_path_factory.mktemp("whole"))


@given(st.lists(TICKS, max_size=3))
def test_inputs_are_recorded_bit_for_bit(ticks: list[Tick]) -> None:
    decoded = decode_ticks(encode_ticks(ticks))
    assert repr(decoded) == repr(ticks)
    assert encode_ticks(decoded) == encode_ticks(ticks)


def test_replay_gives_the_same_map_to_the_bit(whole: Recorded) -> None:
    recording = read(whole.mcap)
    assert recording.is_whole
    app = replay(recording)
    assert encode_plan(app.final_floor_plan()) == encode_plan(whole.flight.plan)
    assert is_same_map(app, recording)
    assert app.flight == whole.flight.app.flight


def test_a_replay_with_another_result_is_reported(whole: Recorded) -> None:
    recording = read(whole.mcap)
    del recording.ticks[600]
    assert is_same_map(replay(recording), recording) is False


def test_recording_does_not_change_the_flight(whole: Recorded, tmp_path: Path) -> None:
    unrecorded = Sitl(tmp_path).fly(SMALL_ROOM)
    assert unrecorded.truth.path == whole.flight.truth.path
    assert unrecorded.plan == whole.flight.plan


def test_another_programs_reader_finds_every_topic(whole: Recorded) -> None:
    with whole.mcap.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        counts = {
            channel.topic: summary.statistics.channel_message_counts.get(id_, 0)
            for id_, channel in summary.channels.items()
        }
        schemas = {schema.name for schema in summary.schemas.values()}
    special = {topics.FAULTS, topics.EARLIER}  # no fault, and no earlier flight of a survey
    ordinary = {topic: count for topic, count in counts.items() if topic not in special}
    assert all(ordinary.values()), counts
    assert {"foxglove.LaserScan", "foxglove.Odometry", "foxglove.SceneUpdate"} <= schemas


def test_the_pose_is_in_enu_with_its_covariance(whole: Recorded) -> None:
    with whole.mcap.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = [m for _, _, _, m in reader.iter_decoded_messages(topics=[topics.POSE])]
    message = messages[200]
    time_s = message.timestamp.seconds + message.timestamp.nanos * 1e-9
    (pose,) = (p for p in read(whole.mcap).poses if abs(p.time_s - time_s) < 1e-6)
    position, turn = message.pose.position, message.pose.orientation
    assert (position.x, position.y, position.z) == (pose.east_m, pose.north_m, -pose.down_m)
    turned_rad = wrap_rad(2 * math.atan2(turn.z, turn.w))
    assert turned_rad == pytest.approx(yaw_ned_to_enu(pose.yaw_rad), abs=1e-9)
    assert message.pose_covariance[0] == pose.position_sigma_m**2 > 0
    assert message.pose_covariance[35] == pose.yaw_sigma_rad**2 > 0


def test_ranges_are_valid_json(whole: Recorded) -> None:
    with whole.mcap.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=[topics.RANGES]):
            readings = json.loads(message.data, parse_constant=pytest.fail)
            assert readings.keys() == {"front", "left", "right", "up", "down"}


def test_the_recording_contains_the_effective_configuration(tmp_path: Path) -> None:
    soon = at(12, crash())  # the beginning of a flight is enough
    flown = recorded(tmp_path, settings={"mission.speed_m_s": 0.7}, script=[soon])
    assert read(flown.mcap).config == flown.flight.config


def test_a_ground_stations_reader_finds_both_ends_of_the_link(whole: Recorded) -> None:
    log = mavutil.mavlink_connection(str(whole.tlog))
    kinds: Counter[tuple[str, int]] = Counter()
    times_s = []
    while (message := log.recv_match()) is not None:
        kinds[message.get_type(), message.get_srcComponent()] += 1
        times_s.append(message._timestamp)
    log.close()
    flown_s = whole.flight.truth.path[-1].time_s
    assert "BAD_DATA" not in {kind for kind, _ in kinds}
    assert kinds["ATTITUDE", 1] > 20 * flown_s
    assert kinds["SET_POSITION_TARGET_LOCAL_NED", 191] > 500
    assert times_s == sorted(times_s)
    assert times_s[-1] - times_s[0] == pytest.approx(flown_s, abs=0.2)


def test_the_tlog_is_the_same_over_every_transport(whole: Recorded, tmp_path: Path) -> None:
    as_bytes = recorded(tmp_path, transport="bytes")
    assert _packets(as_bytes.tlog) == _packets(whole.tlog)


def _packets(tlog: Path) -> list[dict[str, object]]:
    log = mavutil.mavlink_connection(str(tlog))
    packets = []
    while (message := log.recv_match()) is not None:
        packets.append(message.to_dict() | {"from": message.get_srcComponent()})
    log.close()
    return packets


@settings(max_examples=examples(40))
@given(st.data())
def test_a_recording_cut_anywhere_still_opens(whole: Recorded, data: st.DataObject) -> None:
    everything = whole.mcap.read_bytes()
    length = data.draw(st.integers(BEGIN_BYTES, len(everything) - END_BYTES))
    path = whole.mcap.with_name("cut.mcap.part")
    path.write_bytes(everything[:length])
    cut = read(path)
    assert not cut.is_whole
    assert encode_ticks(cut.ticks) == encode_ticks(read(whole.mcap).ticks[: len(cut.ticks)])


def test_faults_and_phases_are_recorded(tmp_path: Path) -> None:
    events = [when("scanning", link_down(for_s=2)), when("returning", unplug("front"))]
    recording = read(recorded(tmp_path, script=events).mcap)
    faults = [(fault.source, fault.text) for fault in recording.faults]
    assert ("flight", "the autopilot is silent") in faults
    assert ("front range sensor", "failed") in faults
    phases = [record.phase for record in recording.phases]
    assert [phase for phase, _ in groupby(phases)][-4:] == ["HOME", "HOLD", "LAND", "DONE"]
    assert recording.phases[-1].trouble == "range sensor failed: front"


def test_a_disk_that_fills_up_ends_the_recording_and_not_the_flight(
    whole: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room_bytes = whole.mcap.stat().st_size * 2 // 3
    write = os.pwrite

    def full(file: int, data: bytes, offset: int) -> int:
        if offset + len(data) > room_bytes:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(file, data, offset)

    monkeypatch.setattr(os, "pwrite", full)
    warnings = _fly_recorded(tmp_path, whole)
    assert len(warnings) == 1
    assert "recording stopped" in warnings[0]
    assert "No space left" in warnings[0]
    (mcap,) = tmp_path.glob("*.mcap")
    assert read(mcap).ticks


def test_a_folder_that_cannot_be_created_prevents_only_the_recording(
    whole: Recorded, tmp_path: Path
) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.write_text("")
    warnings = _fly_recorded(in_the_way, whole)
    assert len(warnings) == 1
    assert "not recorded" in warnings[0]


def test_an_error_of_the_recorder_ends_the_recording_and_not_the_flight(
    whole: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*anything: object) -> None:
        raise ZeroDivisionError("a mistake")

    monkeypatch.setattr("companion.recording.notes.foxglove.transform", broken)
    warnings = _fly_recorded(tmp_path, whole)
    assert len(warnings) == 1
    assert "a mistake" in warnings[0]


def _fly_recorded(folder: Path, like: Recorded) -> list[str]:
    """Fly the same flight again; returns the recorder's warnings."""
    warnings: list[str] = []
    config = configuration.load(None, {})
    recorder = open_recorder(folder, config, 0.0, warnings.append)
    setup = Setup(load_world(SMALL_ROOM), SMALL_ROOM, 1, config.sensors)
    app, _ = fly_in_lockstep(setup, config, ignore_progress, recorder=recorder)
    plan = app.final_floor_plan()
    recorder.close(plan)
    assert plan == like.flight.plan
    return warnings


def ignore_progress(progress: Progress) -> None:
    pass


def test_a_recording_is_smaller_than_three_megabytes_per_minute(whole: Recorded) -> None:
    minutes = whole.flight.truth.path[-1].time_s / 60
    size_mb = (whole.mcap.stat().st_size + whole.tlog.stat().st_size) / 1e6
    assert size_mb / minutes < 3


def test_no_recording_is_overwritten(tmp_path: Path) -> None:
    for _ in range(3):
        recorder = open_recorder(tmp_path, Config(), 0.0, pytest.fail)
        recorder.close(FloorPlan())
    names = sorted(path.stem for path in tmp_path.glob("*.mcap"))
    stem = "flight_1970-01-01_00-00-00"
    assert names == [stem, f"{stem}_2", f"{stem}_3"]


def test_recordings_of_a_team_have_the_number_of_the_drone(tmp_path: Path) -> None:
    """Computers without a network may begin at the same time."""
    team = TeamConfig(name="house", drone=2, pads=(PadConfig(), PadConfig(east_m=2.0)))
    recorder = open_recorder(tmp_path, Config(team=team), 0.0, pytest.fail)
    recorder.close(FloorPlan())
    assert (tmp_path / "flight_1970-01-01_00-00-00_drone_2.mcap").exists()


def test_a_flight_without_ticks_gives_a_valid_recording(tmp_path: Path) -> None:
    open_recorder(tmp_path, Config(), 0.0, pytest.fail).close(FloorPlan())
    (mcap,) = tmp_path.glob("*.mcap")
    recording = read(mcap)
    assert recording.plan == replay(recording).final_floor_plan() == FloorPlan()


def test_recording_can_be_turned_off(tmp_path: Path) -> None:
    config = configuration.load(None, {"recording.enabled": False})
    recorder = open_recorder(tmp_path, config, 0.0, pytest.fail)
    recorder.close(FloorPlan())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("length", range(0, BEGIN_BYTES, 7))
def test_a_recording_cut_near_its_beginning_is_read_or_refused(
    whole: Recorded, tmp_path: Path, length: int
) -> None:
    path = tmp_path / "begun.mcap"
    path.write_bytes(whole.mcap.read_bytes()[:length])
    with suppress(RecordingError):
        assert not read(path).ticks


@pytest.mark.parametrize("content", [b"", b"no recording at all", b"\x89MCAP0\r\n"])
def test_a_file_that_is_no_recording_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="not a recording"):
        read(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"nothing\.mcap: No such file"):
        read(tmp_path / "nothing.mcap")


def test_a_recording_that_has_stopped_keeps_no_messages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stored messages would fill the memory until the flight ends."""
    monkeypatch.setattr(FlightRecorder, "_tick", lambda *_: 1 / 0)
    recorder = FlightRecorder(
        tmp_path / "flight.mcap",
        Config(),
        0.0,
        lambda _: None,
        lambda: 0.0,
        continues="",
        earlier=None,
    )
    autopilot, companion = pipe_pair()
    tap = recorder.tap(companion)
    recorder.tick(0.0, Inputs(Telemetry(VehicleState()), (), RangeScan(0.0, {})), None)  # type: ignore[arg-type]
    autopilot.send(mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 4, 3))
    assert len(tap.receive()) == 1
    assert isinstance(tap, Tap)
    assert tap.take() == []
