"""Worlds that tests of several layers use."""

from pathlib import Path

SMALL_ROOM = str(Path(__file__).parent / "flights/worlds/small_room.toml")
"""World file for a flight of one minute."""

ROOM = """
name = "small room"
height_m = 2.6
walls = [{ points = [[0, 0], [5, 0], [5, 5.5], [0, 5.5]], closed = true }]
starts = [{ name = "middle", position = [2.5, 2.6] }]
"""
"""Text of a world file for a flight of 50 s; a test may add to it."""
