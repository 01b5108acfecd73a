"""Reads logs: from a file's text to arrays in SI units."""
