"""Searches other associations where the measurements contradict the solution."""
