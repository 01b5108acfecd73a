"""Reports to the autopilot and ground stations."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.core.messages import Beam, RangeReading, RangeScan, RangeState
from companion.drivers.autopilot import ORIENTATIONS
from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER
from companion.link.reports import UNKNOWN_SECTOR, Reports
from companion.link.transports.transport import Message, decode, make_codec

ALL = dict.fromkeys(Beam, GP2Y0A710K0F)


def distance(metres: float, sigma_m: float = 0.03) -> RangeReading:
    return RangeReading(RangeState.DISTANCE, metres, sigma_m**2)


def reported(kind: str, **readings: RangeReading) -> list[Message]:
    config = LinkConfig.model_validate({"tell_ranges": kind, "tell_texts": False})
    scan = RangeScan(1.0, {Beam(name): reading for name, reading in readings.items()})
    return Reports(config, ALL).due(1.0, scan, "scanning", "")


def texts(activity: str, trouble: str, reports: Reports) -> list[Message]:
    return reports.due(1.0, RangeScan(1.0, {}), activity, trouble)


def test_no_ranges_are_sent_if_tell_ranges_is_none() -> None:
    assert reported("none", front=distance(2.0)) == []


@pytest.mark.parametrize("beam", list(Beam))
def test_each_beam_is_reported_with_its_orientation(beam: Beam) -> None:
    (message,) = reported("distance_sensor", **{beam.value: distance(2.34)})
    assert ORIENTATIONS[message.orientation] is beam
    assert (message.current_distance, message.covariance) == (234, 9)
    assert (message.min_distance, message.max_distance) == (100, 550)


@pytest.mark.parametrize(
    ("reading", "reported_cm"),
    [
        (RangeReading(RangeState.NOTHING), 551),
        (RangeReading(RangeState.TOO_NEAR), 99),
        (distance(5.6), 550),
    ],
)
def test_only_readings_without_a_distance_are_reported_outside_the_sensors_bounds(
    reading: RangeReading, reported_cm: int
) -> None:
    (message,) = reported("distance_sensor", front=reading)
    assert message.current_distance == reported_cm


@pytest.mark.parametrize("state", [RangeState.STALE, RangeState.FAILED])
@pytest.mark.parametrize("kind", ["distance_sensor", "obstacle_distance"])
def test_a_stale_or_failed_sensor_is_not_reported(kind: str, state: RangeState) -> None:
    assert reported(kind, front=RangeReading(state), down=RangeReading(state)) == []


def test_a_variance_too_large_for_the_field_is_sent_as_unknown() -> None:
    (message,) = reported("distance_sensor", front=distance(5.0, 0.30))
    assert message.covariance == 255


def test_obstacle_distance_has_one_sector_per_beam_and_unknown_elsewhere() -> None:
    around, down = reported(
        "obstacle_distance",
        front=distance(2.0),
        right=RangeReading(RangeState.NOTHING),
        left=RangeReading(RangeState.TOO_NEAR),
        down=distance(1.2),
    )
    assert around.frame == mavlink.MAV_FRAME_BODY_FRD
    known = {i: cm for i, cm in enumerate(around.distances) if cm != UNKNOWN_SECTOR}
    assert known == {0: 200, 18: 551, 54: 100}
    assert down.get_type() == "DISTANCE_SENSOR"
    assert down.orientation == mavlink.MAV_SENSOR_ROTATION_PITCH_270


def test_ranges_are_sent_at_10_hz() -> None:
    config = LinkConfig(tell_ranges="distance_sensor", tell_texts=False)
    reports = Reports(config, {Beam.FRONT: PAPER})
    scan = RangeScan(0.0, {Beam.FRONT: distance(1.0)})
    assert sum(len(reports.due(0.05 * tick, scan, "", "")) for tick in range(200)) == 100


def test_phases_and_faults_are_reported_once() -> None:
    reports = Reports(LinkConfig(), {})
    first = texts("taking off", "", reports)
    assert [(m.severity, m.text) for m in first] == [(6, "PDPS: taking off")]
    assert texts("taking off", "", reports) == []
    (fault,) = texts("holding", "the gyro is silent", reports)
    assert (fault.severity, fault.text) == (4, "PDPS: holding: the gyro is silent")
    assert texts("holding", "the gyro is silent", reports) == []
    (recovered,) = texts("taking off", "", reports)
    assert recovered.severity == 6


@given(st.text(st.characters(codec="ascii", exclude_characters="\0"), min_size=1, max_size=300))
def test_chunks_of_long_texts_can_be_joined(trouble: str) -> None:
    messages = texts("holding", trouble, Reports(LinkConfig(), {}))
    codec = make_codec(1, 191)
    received = decode(codec, b"".join(m.pack(codec) for m in messages))
    assert "".join(m.text for m in received) == f"PDPS: holding: {trouble}"
    assert [m.chunk_seq for m in received] == list(range(len(received)))
    assert len({m.id for m in received}) == 1
    assert all(math.isclose(len(m.text), 50) for m in received[:-1])


def test_each_notice_to_the_pilot_is_reported_once() -> None:
    reports, scan = Reports(LinkConfig(), {}), RangeScan(1.0, {})
    sent = [
        m.text
        for notice in ("", "one", "one", "two")
        for m in reports.due(1.0, scan, "waiting", "", notice)
    ]
    assert sent == ["PDPS: waiting", "PDPS: one", "PDPS: two"]


@pytest.mark.parametrize(
    ("text", "sent"),
    [
        ("turns 3 °/s, 4° off", "turns 3 deg/s, 4 deg off"),
        ("1.2 m ± 3 cm × 2", "1.2 m +/- 3 cm x 2"),
        ("sitl’s clock is gone …", "sitl?s clock is gone ..."),
        ("Küche – größer 机", "Kuche - gro?er ?"),
    ],
)
def test_a_text_is_sent_in_ascii(text: str, sent: str) -> None:
    messages = texts("holding", text, Reports(LinkConfig(), {}))
    assert b"".join(m.text.encode() for m in messages) == f"PDPS: holding: {sent}".encode()


@given(st.text(max_size=200))
def test_any_text_is_sent_in_ascii(trouble: str) -> None:
    for message in texts(trouble, trouble, Reports(LinkConfig(), {})):
        raw = message.text if isinstance(message.text, bytes) else message.text.encode("latin-1")
        assert max(raw, default=0) < 128
