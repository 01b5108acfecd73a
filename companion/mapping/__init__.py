"""Builds the map: floor plan, occupancy grid and heights, from wall lines, hits and readings."""
