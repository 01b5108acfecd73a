"""Draws the floor plan: rooms and openings, dimensions, paper sheet, DXF."""
