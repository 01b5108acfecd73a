"""Writes the floor plan as DXF for CAD."""
