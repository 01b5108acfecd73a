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

TWO_ROOMS = """
name = "two rooms"
height_m = 2.6
walls = [
  { points = [[0, 0], [13, 0], [13, 6], [0, 6]], closed = true },
  { points = [[4.4, 0], [4.4, 2.2], [4.6, 2.2], [4.6, 0]] },
  { points = [[4.4, 6], [4.4, 3.4], [4.6, 3.4], [4.6, 6]] },
]
starts = [{ name = "pad", position = [2.2, 3.0], heading_deg = 30 }]
"""
"""Text of a world file: a room of 26 m² with the pad, and one of 50 m², with a doorway of 1.2 m."""
