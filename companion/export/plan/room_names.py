"""Reads the names of rooms from a TOML file: `"room 1" = "Kitchen"`."""

from collections.abc import Sequence
from pathlib import Path

from companion.config.toml_file import read_toml
from companion.core.errors import ConfigError
from companion.core.textfile import has_control_character


def read_room_names(path: Path, rooms: Sequence[str]) -> dict[str, str]:
    """Names by the rooms' own, which are in `rooms`.

    Raises:
        ConfigError: the file cannot be read, is no such table, or names a room that the map does
            not have.
    """
    names = read_toml(path)
    for room, name in names.items():
        if room not in rooms:
            known = ", ".join(rooms) or "none"
            raise ConfigError(f"{path}: {room} = {name!r}: no such room; the map has: {known}")
        if not isinstance(name, str):
            raise ConfigError(f'{path}: {room} = {name!r} is no text; write "{room}" = "Kitchen"')
        if has_control_character(name):
            raise ConfigError(f"{path}: {room} = {name!r}: contains a control character; remove it")
    return names
