"""A configuration is read completely or rejected in one line."""

from pathlib import Path

import pytest

from companion.app import App
from companion.config.settings import Config, load, mission_settings
from companion.core.errors import ConfigError
from companion.core.messages import Beam


def refused(tmp_path: Path, text: str) -> str:
    path = tmp_path / "drone.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        load(path)
    message = str(error.value)
    assert "drone.toml" in message
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[mission]\nspeed_m_s = 5.0\n", ("mission.speed_m_s", "5.0", "less than or equal to 2")),
        ("[mission]\nheight_m = 'low'\n", ("mission.height_m", "low", "valid number")),
        ("[mission]\nsped = 1\n", ("mission.sped", "no such key", "speed_m_s")),
        ("[wings]\nspan = 1\n", ("wings", "no such key", "mission")),
        ("[link]\nurl = 'com3'\n", ("link.url", "com3", "udpin")),
        ("[sensors]\nprofile = 'lidar'\n", ("sensors.profile", "lidar", "gp2y0a710k0f")),
        ("[sensors]\nbus = 'usb'\n", ("sensors.bus", "usb")),
        (
            "[sensors.ranges]\nfront = {kind = 'lidar'}\n",
            ("sensors.ranges.front.kind", "lidar", "vl53l1x"),
        ),
        (
            "[sensors.ranges]\nfront = {kind = 'vl53l1x', chanel = 1}\n",
            ("sensors.ranges.front.vl53l1x.chanel", "mux_channel"),
        ),
        (
            "[sensors.ranges]\nfront = {kind = 'sharp_mcp3008', channel = 8}\n",
            ("sensors.ranges.front", "channel", "7"),
        ),
        (
            "[sensors.ranges]\nfront = {kind = 'tfmini_s', port = '/dev/a'}\n"
            "up = {kind = 'tf_luna', port = '/dev/a'}\n",
            ("front and up", "same place"),
        ),
        (
            "[sensors.channels]\nfront = {address = 72, channel = 0}\n"
            "up = {address = 72, channel = 0}\n",
            ("front and up", "same place"),
        ),
        (
            "[sensors.calibration]\nfront = {gian = 1.0}\n",
            ("sensors.calibration.front.gian", "gain, offset_m"),
        ),
        (
            "[sensors.channels]\nfront = {address = 1, channel = 0}\n",
            ("sensors.channels.front.address", "72"),
        ),
        ("[mission\n", ("not TOML",)),
    ],
)
def test_an_invalid_configuration_is_refused_with_key_and_reason(
    tmp_path: Path, text: str, words: tuple[str, ...]
) -> None:
    message = refused(tmp_path, text)
    for word in words:
        assert word in message


def test_a_missing_file_is_refused_with_its_name() -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.toml"):
        load(Path("nowhere.toml"))


def test_values_are_read_and_the_rest_is_default(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    path.write_text(
        "[mission]\nspeed_m_s = 0.5\n[sensors.channels]\nfront = {address = 74, channel = 3}\n"
    )
    config = load(path)
    assert config.mission.speed_m_s == 0.5
    assert config.mission.height_m == Config().mission.height_m
    assert list(config.sensors.channels) == [Beam.FRONT]


def test_the_command_line_overrides_the_file(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    path.write_text("[sensors]\nprofile = 'paper'\nrest_s = 5\n")
    config = load(path, {"sensors.profile": "gp2y0a710k0f"})
    assert (config.sensors.profile, config.sensors.rest_s) == ("gp2y0a710k0f", 5)


def test_an_invalid_command_line_option_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"command line: mission\.kind = 'dance'"):
        load(None, {"mission.kind": "dance"})


def test_an_error_names_where_the_wrong_value_comes_from(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    path.write_text("[mission]\nspeed_m_s = 0.5\n")
    with pytest.raises(ConfigError, match=r"^command line: mission\.speed_m_s = 9: "):
        load(path, mission_settings(["speed_m_s=9"]))
    with pytest.raises(ConfigError, match=r"^fast\.toml: mission\.speed_m_s = 9: "):
        load(path, {"mission.speed_m_s": 9}, {"mission.speed_m_s": "fast.toml"})
    path.write_text("[mission]\nspeed_m_s = 9\n")
    with pytest.raises(ConfigError, match=r"drone\.toml: mission\.speed_m_s = 9: "):
        load(path, {"mission.height_m": 1.0})


def test_assignments_on_the_command_line_override_the_mission_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    path.write_text("[mission]\nspeed_m_s = 0.5\nheight_m = 1.0\n")
    mission = load(path, mission_settings(["speed_m_s=0.6", "standoff=range"])).mission
    assert (mission.speed_m_s, mission.standoff, mission.height_m) == (0.6, "range", 1.0)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("speed_m_s=9", ("mission.speed_m_s = 9", "less than or equal to 2")),
        ("standoff=near", ("mission.standoff = 'near'", "0.6 to 5 metres", "'range'")),
        ("sensors.profile=paper", ("mission.sensors.profile", "known here", "speed_m_s")),
        ("speed_m_s", ("--set speed_m_s", "KEY=VALUE")),
    ],
)
def test_an_invalid_assignment_is_refused_with_key_and_bound(
    assignment: str, words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as refused:
        load(None, mission_settings([assignment]))
    assert all(word in str(refused.value) for word in words)


def test_configured_ranges_replace_all_default_sensors(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    path.write_text(
        "[sensors.ranges]\nfront = {kind = 'tf_luna', port = '/dev/ttyS0', mount_offset_m = 0.2}\n"
        "left = {kind = 'vl53l1x'}\n"
    )
    sensors = load(path).sensors
    assert {beam: sensor.kind for beam, sensor in sensors.beams.items()} == {
        Beam.FRONT: "tf_luna",
        Beam.LEFT: "vl53l1x",
    }
    assert (sensors.mount_of_m(Beam.FRONT), sensors.mount_of_m(Beam.LEFT)) == (0.2, 0.08)


def test_a_bearing_far_from_its_beams_direction_is_refused_with_the_key() -> None:
    values = {"sensors": {"ranges": {"left": {"kind": "vl53l1x", "bearing_deg": -45}}}}
    with pytest.raises(ConfigError, match=r"left\.bearing_deg = -45: should be within 20 of -90"):
        App(Config.model_validate(values))


@pytest.mark.parametrize(
    ("team", "words"),
    [
        ("drone = 2", "drone 2 has no start"),
        ("addresses = ['127.0.0.1:1', '127.0.0.1:2']", "addresses has 2 entries, and team.pads 1"),
        ("addresses = ['127.0.0.1:1']\ninterface = 'lo'", "remove one of them"),
    ],
)
def test_a_team_that_does_not_fit_together_is_refused(
    team: str, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "drone.toml"
    path.write_text(f"[team]\nname = 'house'\n{team}\n")
    with pytest.raises(ConfigError, match=words):
        load(path)
