"""Joins the true flights of a survey or a team, for the scores of their joint map."""

import math
from collections.abc import Sequence
from dataclasses import replace

from companion.survey.merge import Merged
from sitl.scoring.report import Outcome as OneOutcome
from sitl.simulation.record import AIRBORNE_M, TruthRecord


class Outcome:
    """How flights at the same time ended."""

    def __init__(self, flights: Sequence[OneOutcome]) -> None:
        self.completed = all(flight.completed for flight in flights)
        self.ending = "; ".join(dict.fromkeys(flight.ending for flight in flights))


def flight_name(number: int) -> str:
    """Name in the joint map of the flight with a number, from 1."""
    return f"flight {number}"


def by_name(truths: Sequence[TruthRecord]) -> dict[str, TruthRecord]:
    """The true flights, in the order of their numbers, by their names in the joint map."""
    return {flight_name(number): truth for number, truth in enumerate(truths, 1)}


def together(truths: Sequence[TruthRecord], merged: Merged) -> TruthRecord:
    """The true flights one after the other, at the times of the joint map.

    `truths`: of all flights in the order of their numbers; the map may have left some out.

    A drone that has landed before its teammates is still recorded; that part is left out, because
    the next flight has those times.
    """
    joint = TruthRecord(truths[0].take_off)
    joint.clearance_m = min(truth.clearance_m for truth in truths)
    joint.hits_ned_m = [place for truth in truths for place in truth.hits_ned_m]
    joint.air_time_s = sum(truth.air_time_s for truth in truths)
    flown = by_name(truths)
    begins_s = [flight.later_s for flight in merged.flights]
    joint.path = [
        later
        for flight, ends_s in zip(merged.flights, [*begins_s[1:], math.inf], strict=True)
        for state in flown[flight.name].path
        if (later := replace(state, time_s=state.time_s + flight.later_s)).time_s < ends_s
    ]
    return joint


def airborne_s(truths: Sequence[TruthRecord]) -> float:
    """Time from the first take-off of several drones to the last landing, s."""
    airborne = [
        state.time_s
        for truth in truths
        for state in truth.path
        if -state.position_ned_m[2] > AIRBORNE_M
    ]
    return max(airborne, default=0.0) - min(airborne, default=0.0)


def apart_m(truths: Sequence[TruthRecord]) -> float | None:
    """Smallest distance between two drones in the air, m; None if no two were in the air."""
    each_m = [truth.apart_m for truth in truths if truth.apart_m is not None]
    return round(min(each_m), 4) if each_m else None


def return_m(truth: TruthRecord) -> float:
    """Distance of the landing place from the take-off place of a flight, m."""
    return math.dist(truth.path[-1].position_ned_m[:2], truth.take_off.position_ned_m[:2])
