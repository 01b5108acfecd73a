"""Estimates that are updated at every tick: heading, position, height, velocity lag."""
