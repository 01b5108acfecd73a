"""Holds what a new flight of a survey knows from the flights before it."""

from dataclasses import dataclass

from companion.core.messages import WallSegment
from companion.estimation.smoothing.estimate import EarlierWalls
from companion.mapping.occupancy import Occupancy


@dataclass(frozen=True, slots=True)
class EarlierFlights:
    """The map of earlier flights, in the frame of the survey: that of the first flight."""

    walls: EarlierWalls
    space: Occupancy
    """Free and occupied space at the height of flight."""
    segments: tuple[WallSegment, ...]
    """The walls, for display."""
