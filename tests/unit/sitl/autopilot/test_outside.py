"""Tests of external poses, ranges and heartbeats, and of their loss (ArduCopter 4.6.3)."""

import math
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import make_codec, pipe_pair, sent_by
from sitl.autopilot.core import Autopilot
from tests.unit.sitl.autopilot.client import (
    ACCEPTED,
    FAILED,
    ORIGIN,
    START,
    Client,
    as_float,
    kinds,
)

VISION_PARAMETERS = {
    "EK3_SRC1_POSXY": 6,
    "EK3_SRC1_VELXY": 6,
    "VISO_TYPE": 1,
    "RNGFND1_TYPE": 10,
    "PRX1_TYPE": 2,
}
FORWARD, DOWN = 0, 25


class VisionClient(Client):
    """A ground station that can also send poses and ranges at 50 Hz."""

    def __init__(self, firmware: str = "ardupilot") -> None:
        super().__init__(firmware)
        self.feeds: set[str] = set()
        self.offset_m = 0.0
        self.resets = 0

    def sets_all(self, **parameters: float) -> None:
        for name, value in parameters.items():
            self.sets(name, value)

    def waits(self, seconds: float) -> list[Any]:
        received: list[Any] = []
        for _ in range(round(seconds * 50)):
            for message in self._fed():
                received += self.sends(message)
            received += super().waits(0.02)
        return received

    def _fed(self) -> Iterator[Any]:
        truth = self.autopilot.truth
        north, east, down = truth.position_ned_m
        if "vision" in self.feeds:
            yield mavlink.MAVLink_vision_position_estimate_message(
                0, north + self.offset_m, east, down, 0, 0, truth.yaw_rad, [0.0] * 21, self.resets
            )
            yield mavlink.MAVLink_vision_speed_estimate_message(0, *truth.velocity_ned_m_s)
        for name, orientation in (("rangefinder", DOWN), ("proximity", FORWARD)):
            if name in self.feeds:
                yield distance(orientation)


def distance(orientation: int, sensor_id: int = 7) -> Any:
    return mavlink.MAVLink_distance_sensor_message(0, 2, 500, 150, 2, sensor_id, orientation, 0)


@pytest.fixture
def client() -> VisionClient:
    client = VisionClient()
    client.sets_all(**VISION_PARAMETERS)
    client.waits(5)
    return client


def flying(client: VisionClient) -> VisionClient:
    client.feeds = {"vision", "rangefinder", "proximity"}
    client.waits(1)
    client.sends(ORIGIN)
    client.result(176, 1, 4)
    assert client.result(400, 1) == ACCEPTED
    assert client.result(22, 0, 0, 0, 0, 0, 0, 1.5) == ACCEPTED
    client.waits(7)
    return client


def flags(client: VisionClient) -> int:
    reported = [m for m in client.commands(512, 193) if m.get_type() == "EKF_STATUS_REPORT"]
    flags: int = reported[0].flags
    return flags


def texts(received: list[Any]) -> list[str]:
    return [m.text for m in received if m.get_type() == "STATUSTEXT"]


def test_each_missing_input_is_named_before_arming(client: VisionClient) -> None:
    for feed, text in (
        ("vision", "Arm: VisOdom: not healthy"),
        ("rangefinder", "Arm: Rangefinder 1: No Data"),
        ("proximity", "Arm: PRX1: No Data"),
    ):
        received = client.commands(400, 1)
        assert (received[0].result, received[1].text) == (FAILED, text)
        client.feeds.add(feed)
        client.waits(0.1)
    assert texts(client.commands(400, 1)) == ["Arm: AHRS: waiting for home"]
    client.sends(ORIGIN)
    assert client.result(400, 1) == ACCEPTED
    assert client.result(400, 1) == ACCEPTED


def test_forced_arming_still_needs_a_position(client: VisionClient) -> None:
    assert texts(client.commands(400, 1, 2989)) == ["Arm: Need Position Estimate"]
    client.feeds = {"vision"}
    client.sends(ORIGIN)
    client.waits(0.1)
    assert client.result(400, 1, 2989) == ACCEPTED


def test_guided_without_gps_needs_no_position(client: VisionClient) -> None:
    client.feeds = {"vision", "rangefinder", "proximity"}
    client.waits(0.1)
    assert client.result(176, 1, 20) == ACCEPTED
    assert client.result(400, 1) == ACCEPTED


def test_estimator_flags_change_when_vision_arrives(client: VisionClient) -> None:
    assert flags(client) == 167
    client.feeds = {"vision"}
    client.sends(ORIGIN)
    client.waits(0.5)
    assert flags(client) == 895


def test_ardupilot_flies_by_vision_alone(client: VisionClient) -> None:
    flying(client)
    for _ in range(40):
        client.velocity(frame=8, mask=0x05C7)
        client.waits(0.05)
    assert client.speed() == pytest.approx(0.95, abs=0.1)
    client.result(511, 32, 20_000)
    estimate = [m for m in client.waits(0.1) if m.get_type() == "LOCAL_POSITION_NED"][-1]
    truth = client.autopilot.truth.position_ned_m
    assert math.dist((estimate.x, estimate.y), truth[:2]) < 0.15


def test_vision_lost_in_hover_ends_in_land_after_eight_seconds(client: VisionClient) -> None:
    flying(client)
    client.feeds.remove("vision")
    client.waits(4.8)
    assert flags(client) == 895
    client.waits(2)
    assert flags(client) == 831
    received = client.waits(1.5)
    assert flags(client) == 37
    assert [t for t in texts(received) if "EKF" in t] == [
        "EKF variance",
        "EKF Failsafe: changed to LAND Mode",
    ]
    beat = [m for m in received if m.get_type() == "HEARTBEAT"][-1]
    assert (beat.custom_mode, beat.base_mode) == (9, 209)
    client.feeds.add("vision")
    received = client.waits(1)
    assert "EKF Failsafe Cleared" in texts(received)
    assert client.autopilot.mode == 9


def test_the_heartbeat_reports_critical_in_failsafe(client: VisionClient) -> None:
    flying(client)
    client.feeds.remove("vision")
    beats = [m for m in client.waits(9.5) if m.get_type() == "HEARTBEAT"]
    assert beats[0].system_status == mavlink.MAV_STATE_ACTIVE
    assert beats[-1].system_status == mavlink.MAV_STATE_CRITICAL


def test_a_reset_moves_the_estimate_at_once(client: VisionClient) -> None:
    flying(client)
    client.offset_m, client.resets = 2.0, 1
    client.result(511, 32, 20_000)
    estimate = [m for m in client.waits(0.1) if m.get_type() == "LOCAL_POSITION_NED"][-1]
    assert estimate.x - client.autopilot.truth.position_ned_m[0] == pytest.approx(2.0, abs=0.2)


def test_ardupilot_accepts_odometry_only_in_local_frd(client: VisionClient) -> None:
    client.sends(ORIGIN)
    level = [1.0, 0.0, 0.0, 0.0]
    zeros = [0.0] * 21
    for frame, child, healthy in ((1, 12, False), (20, 8, False), (20, 12, True)):
        client.sends(
            mavlink.MAVLink_odometry_message(
                *(0, frame, child, 0, 0, 0, level, 0, 0, 0, 0, 0, 0, zeros, zeros, 0)
            )
        )
        assert (flags(client) == 895) == healthy


def test_ranges_are_echoed_with_their_instance(client: VisionClient) -> None:
    client.feeds = {"rangefinder", "proximity"}
    client.result(511, 132, 100_000)
    reported = {m.orientation: m.id for m in client.waits(1) if m.get_type() == "DISTANCE_SENSOR"}
    assert reported == {DOWN: 0, FORWARD: 10}
    client.feeds = set()
    last = [m for m in client.waits(2) if m.get_type() == "DISTANCE_SENSOR"]
    assert 2 * 3 <= len(last) <= 2 * 6


def test_obstacle_distance_counts_as_proximity(client: VisionClient) -> None:
    client.feeds = {"vision", "rangefinder"}
    client.waits(0.1)
    client.sends(mavlink.MAVLink_obstacle_distance_message(0, 0, [200] * 72, 5, 20, 500))
    assert texts(client.commands(400, 1)) == ["Arm: AHRS: waiting for home"]


def test_a_low_battery_lands_the_vehicle_if_configured(client: VisionClient) -> None:
    flying(client)
    client.sets_all(BATT_LOW_VOLT=16.75, BATT_FS_LOW_ACT=1)
    received = client.waits(8)
    assert "Battery 1 is low" in texts(received)
    assert client.autopilot.mode == 9


def test_a_silent_ground_station_lands_the_vehicle_if_configured(client: VisionClient) -> None:
    flying(client)
    client.sets_all(FS_GCS_ENABLE=5)
    client.sends(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3))
    client.waits(4)
    assert client.autopilot.mode == 4
    received = client.waits(2)
    assert "GCS Failsafe" in texts(received)
    assert client.autopilot.mode == 9


def test_px4_warns_when_its_onboard_computer_falls_silent() -> None:
    client = Client("px4")
    client.waits(5)
    client.sends(ORIGIN)
    client.result(400, 1)
    client.result(22, *[math.nan] * 7)
    client.sends(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 0, 3))
    client.receives_texts().waits(2.4)
    assert "Connection to mission computer lost\t" not in texts(client.receives_texts().waits(2.1))
    assert "Connection to mission computer lost\t" in texts(client.receives_texts().waits(1))


def test_px4_without_flow_flies_by_odometry_and_lands_when_it_is_lost() -> None:
    client = VisionClient("px4")
    client.feeds = {"vision"}
    for name, value in ((b"EKF2_OF_CTRL", 0), (b"EKF2_EV_CTRL", 5)):
        client.sends(mavlink.MAVLink_param_set_message(1, 1, name, as_float("<i", value), 6))
    client.waits(5)
    client.sends(ORIGIN)
    assert client.result(400, 1) == ACCEPTED
    client.result(22, *[math.nan] * 7)
    client.waits(8)
    client.feeds = set()
    received = [m for _ in range(3) for m in client.receives_texts().waits(2)]
    assert any("landing" in text for text in texts(received))
    assert "LOCAL_POSITION_NED" not in kinds(client.waits(1))


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_broadcasts_of_other_components_are_forwarded_to_the_other_links(firmware: str) -> None:
    autopilot = Autopilot(1, START, firmware=firmware, links=2)
    for message in (distance(DOWN), mavlink.MAVLink_command_long_message(1, 1, 31999, *[0] * 8)):
        sent_by(message, 197, 0).pack(make_codec(1, 197))
        autopilot.receive(message, 0)
    vehicle_end, end = pipe_pair()
    for message in autopilot.take_outbox(1):
        vehicle_end.send(message)
    assert [(m.get_type(), m.get_srcComponent()) for m in end.receive()] == [
        ("DISTANCE_SENSOR", 197)
    ]
    assert kinds(autopilot.take_outbox(0)) == ["COMMAND_ACK"]
