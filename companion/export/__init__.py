"""Writes the map in the formats of other programs; runs on a laptop, not on the drone."""
