"""Measures what each flight of a survey has added to the joint map."""

import numpy as np

from companion.survey.merge import Merged

CELL_M = 0.25
"""Length of the pieces of wall that are counted, m. Chosen: a few hits of a passing beam."""


def walls_added_m(merged: Merged) -> list[float]:
    """For each flight, the length of wall that it detected first, m."""
    ends_s = [flight.later_s for flight in merged.flights[1:]]
    of_flight = np.searchsorted(ends_s, [hit.time_s for hit in merged.plan.hits], side="right")
    first: dict[tuple[int, int], int] = {}
    tangents = merged.estimate.x.tangents
    for flight, hit in zip(of_flight.tolist(), merged.plan.hits, strict=True):
        if hit.wall is None:
            continue
        along_m = float(tangents[hit.wall] @ hit.position_ned_m[:2])
        first.setdefault((hit.wall, int(along_m // CELL_M)), flight)
    pieces = np.bincount(list(first.values()), minlength=len(merged.flights))
    return [float(CELL_M * count) for count in pieces]
