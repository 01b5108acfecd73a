"""Writes an HTML report of a recorded flight."""
