"""Colours of flights and drones, the same in pictures, pages and reports."""

FLIGHTS = ("#3a86c8", "#e08a1e", "#3f9c58", "#8a5fc2", "#c1121f", "#1aa5a5", "#b0578d", "#7a6a3a")
"""Colours of the first flight of a joint map, or the first drone of a team, the second, ..."""


def flight_colour(number: int) -> str:
    """Colour of a flight or drone by its number, from 0."""
    return FLIGHTS[number % len(FLIGHTS)]
