"""Measurements of the whole: `sitl bench`."""
