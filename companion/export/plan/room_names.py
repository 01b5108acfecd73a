"""Reads the names of rooms from a TOML file: `"room 1" = "Kitchen"`."""

import tomllib
from collections.abc import Sequence
from pathlib import Path

from companion.core.errors import ConfigError
from companion.core.textfile import read_text


def read_room_names(path: Path, rooms: Sequence[str]) -> dict[str, str]:
    """Names by the rooms' own, which are in `rooms`.

    Raises:
        ConfigError: the file is no such table, or names a room that the map does not have.
    """
    try:
        names = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not TOML: {error}") from error
    for room, name in names.items():
        if room not in rooms:
            known = ", ".join(rooms) or "none"
            raise ConfigError(f"{path}: {room} = {name!r}: no such room; the map has: {known}")
        if not isinstance(name, str):
            raise ConfigError(f'{path}: {room} = {name!r} is no text; write "{room}" = "Kitchen"')
    return names
