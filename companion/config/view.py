"""Configuration of the live view."""

from pathlib import Path

from pydantic import Field

from companion.config.range_sensors import Group


class ViewConfig(Group):
    """Live view of map and pose during a flight, read-only."""

    listen: str = Field("", pattern=r"^([^:]+:\d{1,5})?$")
    """`HOST:PORT` for `companion view`. Empty: no live view."""
    token_file: Path | None = None
    """File with the token that viewers need, mode 600. Required unless HOST is 127.0.0.1."""
    foxglove: str = Field("", pattern=r"^([^:]+:\d{1,5})?$")
    """`HOST:PORT` of the live stream for Foxglove. Empty: no stream."""
    foxglove_open: bool = False
    """Whether other machines may receive the stream, which has no token. Required unless HOST is
    127.0.0.1."""
