"""The map in the formats that other programs open; for a laptop, not for the drone."""
