"""Measures the whole system: `sitl bench`."""
