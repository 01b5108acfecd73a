"""Finds which flight of a survey detected each piece of wall first."""

from dataclasses import dataclass

import numpy as np

from companion.core.frames import Vector2
from companion.survey.merge import Merged

CELL_M = 0.25
"""Length of the pieces of wall that are counted, m. Chosen: a few hits of a passing beam."""


@dataclass(frozen=True, slots=True)
class AddedPiece:
    """A piece of wall of `CELL_M`, and the number of the flight that detected it first, from 0."""

    flight: int
    start_ne_m: Vector2
    end_ne_m: Vector2


def pieces_added(merged: Merged) -> list[AddedPiece]:
    """All pieces of the joint map's walls."""
    ends_s = [flight.later_s for flight in merged.flights[1:]]
    of_flight = np.searchsorted(ends_s, [hit.time_s for hit in merged.plan.hits], side="right")
    first: dict[tuple[int, int], int] = {}
    x = merged.estimate.x
    tangents, feet = x.tangents, x.walls[:, 1:] * x.normals
    for flight, hit in zip(of_flight.tolist(), merged.plan.hits, strict=True):
        if hit.wall is None:
            continue
        along_m = float(tangents[hit.wall] @ hit.position_ned_m[:2])
        first.setdefault((hit.wall, int(along_m // CELL_M)), flight)
    pieces = []
    for (wall, cell), flight in first.items():
        ends = (feet[wall] + CELL_M * at * tangents[wall] for at in (cell, cell + 1))
        start, end = ((float(north_m), float(east_m)) for north_m, east_m in ends)
        pieces.append(AddedPiece(flight, start, end))
    return pieces


def walls_added_m(merged: Merged) -> list[float]:
    """For each flight, the length of wall that it detected first, m."""
    flights = [piece.flight for piece in pieces_added(merged)]
    return [CELL_M * flights.count(number) for number in range(len(merged.flights))]
