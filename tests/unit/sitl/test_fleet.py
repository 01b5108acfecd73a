"""Tests of several vehicles in one world: they detect each other and can collide."""

import math
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import SensorsConfig
from companion.core.messages import Beam
from companion.drivers.ranges import RangeSensors
from companion.link.requests import command_long
from companion.link.transports.transport import Transport, direct_pair
from sitl.autopilot.core import keep_nothing
from sitl.core.errors import SitlError
from sitl.core.truth import TrueState
from sitl.simulation.fleet import Fleet, fleet_setups
from sitl.simulation.simulation import Setup
from sitl.simulation.traffic import (
    JET_M_S,
    clearance_to_others_m,
    downwash_m_s,
    with_crosstalk,
    with_others,
)
from sitl.world.format import parse_world
from sitl.world.geometry.model import BODY_RADIUS_M

HALL = """
name = "hall"
height_m = 3.0
[[walls]]
points = [[0, 0], [12, 0], [12, 12], [0, 12]]
closed = true
[[starts]]
name = "one"
position = [4, 6]
heading_deg = 0
[[starts]]
name = "other"
position = [6.5, 6]
heading_deg = 60
"""
APART_M = 2.5
PLACE = (473_977_000, 85_456_000, 488_000)
SENSORS = SensorsConfig()
VELOCITY_AND_YAW_RATE = 0x05C7


class Pair:
    """Two vehicles in the hall, with a link to each."""

    def __init__(self) -> None:
        setup = Setup(parse_world(HALL, "hall"), "hall", 3, SENSORS)
        setups = fleet_setups(setup, 2)
        pairs = [direct_pair(each.system_id) for each in setups]
        self.ends: list[Transport] = [end for _, end in pairs]
        self.fleet = Fleet(setups, [[vehicle] for vehicle, _ in pairs], keep_nothing)
        self.systems = [each.system_id for each in setups]

    def waits(self, seconds: float) -> None:
        self.fleet.advance(self.fleet.time_s + seconds)

    def commands(self, number: int, command: int, *parameters: float) -> None:
        target = self.systems[number], mavlink.MAV_COMP_ID_AUTOPILOT1
        self.ends[number].send(command_long(target, command, parameters))
        self.waits(0.1)

    def take_off(self) -> None:
        self.waits(5)
        for number, end in enumerate(self.ends):
            end.send(mavlink.MAVLink_set_gps_global_origin_message(self.systems[number], *PLACE))
            self.waits(0.1)
            self.commands(number, mavlink.MAV_CMD_DO_SET_MODE, 1, 4)
            self.commands(number, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
            self.commands(number, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 1.5)
        self.waits(6)

    def flies_ahead(self, number: int, seconds: float) -> None:
        for _ in range(round(seconds * 10)):
            system = self.systems[number]
            self.ends[number].send(
                mavlink.MAVLink_set_position_target_local_ned_message(
                    *(0, system, 1, mavlink.MAV_FRAME_BODY_NED, VELOCITY_AND_YAW_RATE),
                    *(0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0, 0),
                )
            )
            self.waits(0.1)

    def texts(self, number: int) -> list[str]:
        messages: list[Any] = self.ends[number].receive()
        return [m.text for m in messages if m.get_type() == "STATUSTEXT"]


def test_each_vehicle_has_its_own_system_id_start_and_noise() -> None:
    first, other = Pair().fleet.vehicles
    setups = fleet_setups(Setup(parse_world(HALL, "hall"), "hall", 3, SENSORS), 2)
    assert [each.system_id for each in setups] == [1, 2]
    assert setups[0].seed != setups[1].seed
    assert (first.autopilot.system_id, other.autopilot.system_id) == (1, 2)
    assert first.record.take_off.position_ned_m[0] == 4
    assert other.record.take_off.position_ned_m[0] == 6.5


def test_more_vehicles_than_starts_are_refused() -> None:
    setup = Setup(parse_world(HALL, "hall"), "hall", 3, SENSORS)
    with pytest.raises(SitlError, match=r"hall has 2 start poses, 3 vehicles need one each"):
        fleet_setups(setup, 3)


def test_a_beam_detects_the_other_vehicle() -> None:
    pair = Pair()
    pair.waits(0.2)
    scan = RangeSensors(pair.fleet.vehicles[0].board.bus, SENSORS).read(0.2)
    seen_m = scan.readings[Beam.FRONT].distance_m
    assert seen_m == pytest.approx(APART_M - BODY_RADIUS_M - SENSORS.mount_offset_m, abs=0.1)


def test_both_vehicles_crash_when_they_collide() -> None:
    pair = Pair()
    pair.take_off()
    assert [vehicle.record.collisions for vehicle in pair.fleet.vehicles] == [0, 0]
    pair.flies_ahead(0, 4)
    for number, vehicle in enumerate(pair.fleet.vehicles):
        assert vehicle.record.collisions >= 1
        assert "Crash: hit an obstacle" in pair.texts(number)
        assert vehicle.autopilot.truth.position_ned_m[2] == 0


@pytest.mark.parametrize(
    ("direction", "wall_m", "seen_m"),
    [
        ((1.0, 0.0, 0.0), None, 3 - BODY_RADIUS_M),
        ((1.0, 0.0, 0.0), 2.0, 2.0),
        ((1.0, 0.0, 0.0), 4.0, 3 - BODY_RADIUS_M),
        ((-1.0, 0.0, 0.0), 4.0, 4.0),
        ((0.0, 1.0, 0.0), None, None),
    ],
)
def test_a_beam_ends_at_the_nearest_obstacle(
    direction: tuple[float, float, float], wall_m: float | None, seen_m: float | None
) -> None:
    query = with_others(lambda origin, direction, most_m: wall_m, lambda: [(3.0, 0.0, -1.0)])
    assert query((0.0, 0.0, -1.0), direction, 5.0) == seen_m


def test_the_clearance_is_between_the_bodies() -> None:
    others = [(3.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    assert clearance_to_others_m((0.0, 0.0, 0.0), others) == pytest.approx(1 - 2 * BODY_RADIUS_M)
    assert clearance_to_others_m((0.0, 0.0, 0.0), []) == math.inf


def test_the_air_below_a_vehicle_pushes_down_what_is_there() -> None:
    above = [(0.0, 0.0, -2.0)]
    assert 0.5 * JET_M_S < downwash_m_s((0.0, 0.0, -1.3), above) < JET_M_S
    assert downwash_m_s((1.5, 0.0, -1.3), above) < 1e-6
    assert downwash_m_s((0.0, 0.0, -2.7), above) == 0.0


def facing(yaw_rad: float) -> TrueState:
    return TrueState(0.0, (3.0, 0.0, -1.2), (0.0, 0.0, 0.0), 0.0, 0.0, yaw_rad, 0.0)


@pytest.mark.parametrize(("yaw_rad", "is_dazzled"), [(math.pi, True), (math.pi + 0.3, False)])
def test_infrared_sensors_that_face_each_other_dazzle(yaw_rad: float, is_dazzled: bool) -> None:
    walls = with_others(lambda origin, direction, most_m: 5.0, lambda: [(3.0, 0.0, -1.2)])
    query = with_crosstalk(walls, lambda: [facing(yaw_rad)], Random(1))
    measured = {query((0.0, 0.0, -1.2), (1.0, 0.0, 0.0), 5.5) for _ in range(20)}
    assert all(distance_m <= 3.0 - BODY_RADIUS_M for distance_m in measured if distance_m)
    assert (len(measured) > 10) == is_dazzled


def test_a_wall_before_a_vehicle_shields_its_light() -> None:
    walls = with_others(lambda origin, direction, most_m: 2.0, lambda: [(3.0, 0.0, -1.2)])
    query = with_crosstalk(walls, lambda: [facing(math.pi)], Random(1))
    assert query((0.0, 0.0, -1.2), (1.0, 0.0, 0.0), 5.5) == 2.0
