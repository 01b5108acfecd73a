"""Sensors with conflicting connections are rejected in one line."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.errors import ConfigError


def tof(mux: int | None = None, channel: int = 0, address: int = 0x29) -> dict[str, Any]:
    behind = {} if mux is None else {"mux_address": mux, "mux_channel": channel}
    return {"kind": "vl53l1x", "address": address, **behind}


def sharp(address: int, channel: int) -> dict[str, Any]:
    return {"kind": "sharp_ads1115", "address": address, "channel": channel}


def spi(channel: int, reference_v: float = 3.3) -> dict[str, Any]:
    return {"kind": "sharp_mcp3008", "channel": channel, "reference_v": reference_v}


@pytest.mark.parametrize(
    ("ranges", "words"),
    [
        ({"front": tof(0x70), "left": tof()}, ("left", "front behind 0x70", "0x29")),
        ({"front": tof(0x71), "left": tof(address=0x29)}, ("left", "front", "0x29")),
        ({"front": tof(), "left": tof()}, ("front and left", "same place")),
        ({"front": tof(0x70, 3), "left": tof(0x70, 3)}, ("front and left", "same place")),
        ({"front": tof(0x70), "left": tof(address=0x70)}, ("left", "multiplexer", "0x70")),
        ({"front": tof(0x70), "left": tof(0x71, 0, 0x70)}, ("left", "multiplexer", "0x70")),
        ({"front": tof(address=0x48), "left": sharp(0x48, 0)}, ("front", "ADS1115", "0x48")),
        ({"front": tof(0x70, 0, 0x49), "left": sharp(0x49, 0)}, ("front", "ADS1115", "0x49")),
        ({"front": sharp(0x48, 1), "left": sharp(0x48, 1)}, ("front and left", "same place")),
        ({"front": tof(address=0x6B)}, ("the gyro", "front", "0x6b")),
        ({"front": tof(0x70, 0, 0x6B)}, ("the gyro", "front", "0x6b")),
        ({"front": spi(0), "left": spi(1, 5.0)}, ("front", "left", "/dev/spidev0.0", "5")),
        ({"front": spi(0, 3.0)}, ("reference_v", "3.2")),
    ],
)
def test_conflicting_connections_are_refused(
    ranges: Mapping[str, Any], words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as refused:
        configuration.load(None, {"sensors.ranges": ranges})
    assert all(word in str(refused.value) for word in words), str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "ranges",
    [
        {"front": tof(0x70, 0), "left": tof(0x70, 1), "right": tof(0x71, 0), "up": tof(0x71, 1)},
        {"front": tof(0x70, 0), "left": tof(address=0x30)},
        {"front": tof(0x70, 0), "left": tof(0x70, 0, 0x30)},
        {"front": tof(), "left": sharp(0x48, 0), "right": sharp(0x49, 0)},
        {"front": spi(0, 5.0), "left": spi(1, 5.0), "right": sharp(0x48, 0)},
    ],
)
def test_distinct_connections_are_accepted(ranges: Mapping[str, Any]) -> None:
    configuration.load(None, {"sensors.ranges": ranges})


def test_the_autopilots_gyro_occupies_no_i2c_address() -> None:
    sensors = {"gyro": "autopilot", "ranges": {"front": tof(address=0x6B)}}
    Config.model_validate({"sensors": sensors})


def test_the_link_and_a_sensor_cannot_share_a_port(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    path.write_text("[link]\nurl = 'serial:/dev/ttyAMA1:921600'\n[sensors]\nprofile = 'tfmini_s'\n")
    with pytest.raises(ConfigError, match=r"link\.url and sensors\.ranges\.front\.port"):
        configuration.load(path)
    path.write_text(path.read_text().replace("AMA1", "AMA0"))
    configuration.load(path)
