"""Finds which flight of a survey detected each piece of wall first."""

from collections.abc import Sequence
from dataclasses import dataclass

from companion.core.frames import Vector2
from companion.estimation.smoothing.state import place_on
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
    hits, x = merged.plan.hits, merged.estimate.x
    first: dict[tuple[int, int], int] = {}
    tangents = x.tangents
    for flight, hit in zip(merged.flight_of([hit.time_s for hit in hits]), hits, strict=True):
        if hit.wall is None:
            continue
        along_m = float(tangents[hit.wall] @ hit.position_ned_m[:2])
        first.setdefault((hit.wall, int(along_m // CELL_M)), flight)
    pieces = []
    for (wall, cell), flight in first.items():
        start, end = (place_on(x.walls[wall], CELL_M * at) for at in (cell, cell + 1))
        pieces.append(AddedPiece(flight, start, end))
    return pieces


def walls_added_m(pieces: Sequence[AddedPiece], flights: int) -> list[float]:
    """For each flight, the length of wall that it detected first, m."""
    first = [piece.flight for piece in pieces]
    return [CELL_M * first.count(number) for number in range(flights)]
