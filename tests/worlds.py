"""Worlds that tests of several kinds fly in."""

from pathlib import Path

SMALL_ROOM = str(Path(__file__).parent / "flights/worlds/small_room.toml")
"""Flown in a minute."""
