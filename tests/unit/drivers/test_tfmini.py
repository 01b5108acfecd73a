"""The TFmini-S: frames in a stream of bytes, and their meaning."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import RangeState
from companion.drivers.chips.tfmini import FRAME, HEADER, Tfmini, checksum, latest_frame
from companion.drivers.chips.time_of_flight import TFMINI_S
from sitl.sensors.tfmini import frame


def raw(distance_cm: int, strength: int) -> bytes:
    body = FRAME.pack(HEADER, distance_cm, strength, 2400, 0)[:-1]
    return body + bytes([checksum(body)])


class Port:
    """Returns bytes set by the test."""

    def __init__(self) -> None:
        self.data = b""

    def receive(self, port: str, baud: int) -> bytes:
        data, self.data = self.data, b""
        return data


@given(st.integers(0, 1200), st.integers(100, 65534), st.lists(st.integers(1, 8), max_size=4))
def test_a_frame_in_any_pieces_is_found(distance_cm: int, strength: int, cuts: list[int]) -> None:
    data, rest, found = raw(distance_cm, strength), b"", None
    edges = sorted({0, len(data), *cuts})
    for start, end in pairwise(edges):
        new, rest = latest_frame(rest + data[start:end])
        found = new or found
    assert found == (distance_cm, strength)


@given(st.binary(max_size=40), st.integers(0, 1200))
def test_a_frame_is_found_within_two_frames_after_any_garbage(garbage: bytes, cm: int) -> None:
    found, _ = latest_frame(garbage + raw(cm, 500) + raw(cm, 500))
    assert found == (cm, 500)


def test_the_latest_of_several_frames_is_returned() -> None:
    found, rest = latest_frame(frame(1.0) + frame(2.0) + frame(3.0)[:5])
    assert found == (200, 2000)
    assert latest_frame(rest + frame(3.0)[5:])[0] == (300, 2000)


@pytest.mark.parametrize(
    ("distance_cm", "strength", "state"),
    [
        (200, 500, RangeState.DISTANCE),
        (5, 500, RangeState.TOO_NEAR),
        (1300, 500, RangeState.NOTHING),
        (200, 99, RangeState.NOTHING),
        (0xFFFF, 30, RangeState.NOTHING),
        (0, 20, RangeState.NOTHING),
    ],
)
def test_distance_and_strength_determine_the_state(
    distance_cm: int, strength: int, state: RangeState
) -> None:
    port = Port()
    sensor = Tfmini(port, "/dev/ttyAMA1", 115200, TFMINI_S)
    port.data = raw(distance_cm, strength)
    reading = sensor.read(0.0)
    assert reading is not None
    assert reading.state is state


@pytest.mark.parametrize(
    "values", [(0xFFFE, 0xFFFF), (0xFFFC, 500), (300, 0xFFFF), (0xFFFD, 500), (0x8000, 50)]
)
def test_a_saturated_sensor_gives_no_reading(values: tuple[int, int]) -> None:
    port = Port()
    sensor = Tfmini(port, "/dev/ttyAMA1", 115200, TFMINI_S)
    port.data = raw(*values)
    assert sensor.read(0.0) is None
