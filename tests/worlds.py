"""Worlds that tests of several layers use."""

from pathlib import Path

SMALL_ROOM = str(Path(__file__).parent / "flights/worlds/small_room.toml")
"""World file for a flight of one minute."""
