"""DISTANCE_SENSOR messages: distance, free space, or no measurement."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.range_sensors import AutopilotRange
from companion.core.messages import Beam, RangeState
from companion.drivers.autopilot import AutopilotRanges

FRONT = mavlink.MAV_SENSOR_ROTATION_NONE


def state(current_cm: int, min_cm: int = 20, max_cm: int = 800, quality: int = 0) -> RangeState:
    """State after one message; FAILED without a reading."""
    sensors = AutopilotRanges({Beam.FRONT: AutopilotRange(min_m=0.2, max_m=8.0)})
    message = mavlink.MAVLink_distance_sensor_message(
        *(77, min_cm, max_cm, current_cm, mavlink.MAV_DISTANCE_SENSOR_LASER, 1, FRONT, 0),
        signal_quality=quality,
    )
    sensors.receive(message, 1.0)
    reading = sensors.read(1.0).get(Beam.FRONT)
    return reading.state if reading else RangeState.FAILED


@pytest.mark.parametrize(
    ("current_cm", "expected"),
    [
        (0, RangeState.FAILED),
        (1, RangeState.TOO_NEAR),
        (19, RangeState.TOO_NEAR),
        (20, RangeState.DISTANCE),
        (799, RangeState.DISTANCE),
        (801, RangeState.NOTHING),
        (5000, RangeState.NOTHING),
        (65535, RangeState.FAILED),
    ],
)
def test_only_a_distance_beyond_the_maximum_is_free_space(
    current_cm: int, expected: RangeState
) -> None:
    assert state(current_cm) is expected


@pytest.mark.parametrize("current_cm", [0, 10, 200, 801, 65535])
def test_a_message_with_the_quality_invalid_gives_no_reading(current_cm: int) -> None:
    assert state(current_cm, quality=1) is RangeState.FAILED


@pytest.mark.parametrize(("min_cm", "max_cm"), [(0, 0), (20, 0), (20, 20)])
def test_invalid_bounds_are_replaced_by_those_of_the_configuration(
    min_cm: int, max_cm: int
) -> None:
    assert state(300, min_cm, max_cm) is RangeState.DISTANCE
    assert state(10, min_cm, max_cm) is RangeState.TOO_NEAR
    assert state(900, min_cm, max_cm) is RangeState.NOTHING


def message_of(sensor_id: int, current_cm: int) -> mavlink.MAVLink_distance_sensor_message:
    kind = mavlink.MAV_DISTANCE_SENSOR_LASER
    return mavlink.MAVLink_distance_sensor_message(0, 20, 800, current_cm, kind, sensor_id, 0, 0)


def test_of_two_sensors_in_one_direction_the_lowest_id_is_read() -> None:
    """ArduPilot sends a rangefinder again as proximity, with id 10."""
    sensors = AutopilotRanges({Beam.FRONT: AutopilotRange(min_m=0.2, max_m=8.0)})
    sensors.receive(message_of(10, 500), 0.0)
    for tick in range(1, 100):
        sensors.receive(message_of(0, 300), 0.05 * tick)
        sensors.receive(message_of(10, 500), 0.05 * tick)
        assert sensors.read(0.05 * tick)[Beam.FRONT].distance_m == 3.0


def test_a_sensor_that_has_failed_is_not_replaced_before_the_landing() -> None:
    sensors = AutopilotRanges({Beam.FRONT: AutopilotRange(min_m=0.2, max_m=8.0)})
    sensors.receive(message_of(0, 300), 0.0)
    for tick in range(1, 60):
        sensors.receive(message_of(10, 500), 0.05 * tick)
    assert Beam.FRONT not in sensors.read(3.0)
    sensors.receive(message_of(10, 500), 6.0)  # a restarted autopilot numbers them anew
    assert sensors.read(6.0)[Beam.FRONT].distance_m == 5.0
