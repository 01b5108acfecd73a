"""Text files are read from any editor, system and locale."""

import codecs
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config import settings
from companion.core.errors import ConfigError
from companion.core.secret import read_token
from companion.core.textfile import NotTextError, decoded
from sitl.autopilot.parameters.file import ParameterFile
from sitl.autopilot.parameters.table import load_table
from sitl.sensors.beam import load_beam_physics
from sitl.testing.mission_file import load_mission
from sitl.world.format import WorldError
from sitl.world.loading import load_world

ROOM = """name = "Küche"
height_m = 2.6
[[walls]]
points = [[0, 0], [4, 0], [4, 3], [0, 3]]
closed = true
[[starts]]
name = "Tür"
position = [2, 1.5]
"""
PLAN = json.dumps(
    {"name": "Küche", "walls": [[0, 0, 5, 0], [5, 0, 5, 4], [5, 4, 0, 4], [0, 4, 0, 0]]},
    ensure_ascii=False,
)
AS_SAVED = {
    "plain": lambda text: text.encode(),
    "Notepad": lambda text: codecs.BOM_UTF8 + text.replace("\n", "\r\n").encode(),
    "PowerShell": lambda text: text.replace("\n", "\r\n").encode("utf-16"),
    "big-endian UTF-16": lambda text: codecs.BOM_UTF16_BE + text.encode("utf-16-be"),
}


@pytest.fixture(params=AS_SAVED)
def saved(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    """Saves a text as an editor does; the default encoding of the machine differs."""
    monkeypatch.setattr("locale.getpreferredencoding", lambda *_: "cp437")
    monkeypatch.setattr("io.text_encoding", lambda encoding, *_: encoding or "cp437")

    def save(name: str, text: str) -> Path:
        path = tmp_path / name
        path.write_bytes(AS_SAVED[request.param](text))
        return path

    return save


def test_a_world_is_read(saved) -> None:  # type: ignore[no-untyped-def]
    world = load_world(str(saved("room.toml", ROOM)))
    assert (world.name, world.starts[0].name) == ("Küche", "Tür")


def test_a_plan_is_read(saved) -> None:  # type: ignore[no-untyped-def]
    assert load_world(str(saved("plan.json", PLAN))).name == "Küche"


def test_the_drones_configuration_is_read_and_changed(saved) -> None:  # type: ignore[no-untyped-def]
    path = saved("drone.toml", '# Küche\n[mission]\nkind = "building"\n')
    assert settings.load(path, {}).mission.kind == "building"
    settings.update(path, "sensors.gyro_gain", 1.01)
    assert settings.load(path, {}).sensors.gyro_gain == 1.01
    assert "# Küche" in path.read_text(encoding="utf-8")


def test_a_mission_is_read(saved) -> None:  # type: ignore[no-untyped-def]
    mission = load_mission(str(saved("mission.toml", "[mission]\nspeed_m_s = 0.7\n")))
    assert mission.settings == {"mission.speed_m_s": 0.7}


def test_beam_physics_are_read(saved) -> None:  # type: ignore[no-untyped-def]
    assert load_beam_physics(saved("beam.toml", "dropout = 0.25 # Küche\n")).dropout == 0.25


def test_parameters_are_read(saved) -> None:  # type: ignore[no-untyped-def]
    path = saved("vehicle.parm", "# Küche\nGUID_TIMEOUT 0.5\n")
    assert ParameterFile(path, load_table("ardupilot")).values == {"GUID_TIMEOUT": 0.5}


def test_a_token_is_read(saved) -> None:  # type: ignore[no-untyped-def]
    path = saved("token", "0123456789abcdef\n")
    path.chmod(0o600)
    assert read_token(path, "--token-file") == "0123456789abcdef"


@pytest.mark.parametrize(
    ("name", "text"), [("room.toml", ROOM), ("plan.json", PLAN), ("map.yaml", "image: Küche.pgm")]
)
def test_an_unknown_encoding_is_refused_with_the_line_and_the_remedy(
    tmp_path: Path, name: str, text: str
) -> None:
    path = tmp_path / name
    path.write_bytes(text.encode("cp1252"))
    with pytest.raises(WorldError, match=r"line 1: byte 0xfc is not UTF-8; save the file as UTF-8"):
        load_world(str(path))


def test_an_unknown_encoding_of_a_configuration_is_a_one_line_error(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    path.write_bytes('[link]\n# Küche\nurl = "udpin:0.0.0.0:1"\n'.encode("cp1252"))
    with pytest.raises(ConfigError, match=rf"^{path}: line 2: byte 0xfc is not UTF-8; save"):
        settings.load(path, {})
    with pytest.raises(ConfigError, match=rf"^{tmp_path / 'none'}: No such file or directory$"):
        settings.load(tmp_path / "none", {})


def test_utf_16_without_a_byte_order_mark_is_refused() -> None:
    with pytest.raises(NotTextError, match="UTF-16"):
        decoded("name = 1".encode("utf-16-le"))


@given(st.text(st.characters(exclude_characters="\r\0\ufeff", codec="utf-16")))
def test_every_text_is_the_same_after_saving_and_reading(text: str) -> None:
    for save in AS_SAVED.values():
        assert decoded(save(text)) == text  # type: ignore[no-untyped-call]
