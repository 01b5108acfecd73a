"""Tests of flights with sensors other than five Sharps, and with mixed sensors."""

from pathlib import Path

import pytest

from companion.export.plan.survey import survey
from sitl.testing import Sitl, at, crash, unplug

SMALL = "worlds/small_room.toml"
MIX = """
[sensors]
gyro = "autopilot"
mount_offset_m = 0.08

[sensors.ranges]
front = { kind = "vl53l1x", mount_offset_m = 0.12 }
left = { kind = "sharp_mcp3008", channel = 3 }
right = { kind = "tfmini_s", port = "/dev/ttyUSB0", mount_offset_m = 0.05 }
up = { kind = "sharp_ads1115", address = 0x48, channel = 0 }
down = { kind = "autopilot" }
"""
FROM_AUTOPILOT = """
[sensors]
gyro = "autopilot"
ranges = { front = { kind = "autopilot" }, left = { kind = "autopilot" }, \
right = { kind = "autopilot" } }
"""


BENT = """
[sensors.ranges]
front = { kind = "sharp_ads1115", address = 0x48, channel = 0, bearing_deg = 6 }
left = { kind = "sharp_ads1115", address = 0x48, channel = 1, bearing_deg = -78 }
right = { kind = "sharp_ads1115", address = 0x48, channel = 2, bearing_deg = 97 }
up = { kind = "sharp_ads1115", address = 0x48, channel = 3 }
down = { kind = "sharp_ads1115", address = 0x49, channel = 0 }
"""


@pytest.mark.parametrize("profile", ["vl53l1x", "tfmini_s", "tf_luna"])
def test_a_room_is_mapped_with_other_sensors(sitl: Sitl, profile: str) -> None:
    flight = sitl.fly("room_100", profile=profile)
    assert flight.completed, flight.ending
    assert flight.report.collisions == 0
    assert flight.report.coverage >= 0.95
    assert (
        flight.report.wall_error_aligned_cm <= 5
    )  # a VL53L1X never detects two opposite walls at once


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize("sensors", [MIX, FROM_AUTOPILOT], ids=["mix", "from the autopilot"])
def test_a_room_is_mapped_with_mixed_sensors(
    sitl: Sitl, tmp_path: Path, sensors: str, autopilot: str
) -> None:
    config = tmp_path / "drone.toml"
    config.write_text(sensors)
    flight = sitl.fly("room_100", config=str(config), autopilot=autopilot)
    assert flight.completed, flight.ending
    assert flight.report.collisions == 0
    assert flight.report.coverage >= 0.95
    assert flight.report.wall_error_aligned_cm <= 12


@pytest.mark.parametrize(
    ("world", "rooms_m2"), [("room_100", [100]), ("worlds/small_office.toml", [22.8, 22.2])]
)
def test_configured_mount_angles_keep_the_map_accurate(
    sitl: Sitl, tmp_path: Path, world: str, rooms_m2: list[float]
) -> None:
    config = tmp_path / "drone.toml"
    config.write_text(BENT)
    mission = "room" if world == "room_100" else "building"
    flight = sitl.fly(world, mission=mission, config=str(config))
    assert flight.completed, flight.ending
    assert flight.report.collisions == 0
    assert flight.report.coverage >= 0.93
    assert flight.report.wall_error_aligned_cm <= 5
    areas_m2 = [room.area_m2 for room in survey(flight.plan).rooms]
    assert areas_m2 == pytest.approx(rooms_m2, rel=0.03)  # walls continue behind furniture


def test_mixed_sensors_give_the_same_flight_over_every_transport(
    sitl: Sitl, tmp_path: Path
) -> None:
    config = tmp_path / "drone.toml"
    config.write_text(MIX)
    ends = [at(25, crash())]
    first = sitl.fly(SMALL, config=str(config), seed=5, script=ends)
    as_bytes = sitl.fly(SMALL, config=str(config), seed=5, transport="bytes", script=ends)
    assert first.truth.path == as_bytes.truth.path
    assert first.plan == as_bytes.plan


@pytest.mark.parametrize("profile", ["vl53l1x", "tfmini_s"])
def test_a_dead_sensor_of_any_kind_lands_the_drone(sitl: Sitl, profile: str) -> None:
    flight = sitl.fly("room_100", profile=profile, script=[at(30, unplug("left"))])
    assert flight.ending == "landed: range sensor failed: left"
    assert flight.truth.collisions == 0
