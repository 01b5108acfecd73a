"""Computes the numbers of the report from a recording."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from companion.core.arrays import Array
from companion.core.messages import Beam, FloorPlan, RangeState, WallSegment
from companion.mapping.floor_plan import outline_closed
from companion.recording.reader import Recording
from companion.recording.topics import PhaseRecord

SAMPLE_M = 0.25
"""Distance between sample points on a wall, m. Chosen."""
MET_WITHIN_M = 0.35
"""Largest distance of a hit from a sample point that it detects, m. Chosen."""


@dataclass(frozen=True, slots=True)
class Span:
    """One activity of the flight, with its phase, begin and end."""

    activity: str
    phase: str
    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class BeamUse:
    """Share of each state in all readings of a range sensor, 0 to 1."""

    beam: Beam
    shares: dict[RangeState, float]


def spans(phases: Sequence[PhaseRecord], end_s: float) -> list[Span]:
    """Activities in order of time; each ends when the next begins."""
    begins = [
        record
        for last, record in pairwise([None, *phases])
        if record is not None and (last is None or last.activity != record.activity)
    ]
    ends_s = [*[record.time_s for record in begins[1:]], end_s]
    return [
        Span(record.activity, record.phase, record.time_s, stop_s)
        for record, stop_s in zip(begins, ends_s, strict=True)
    ]


def ending(recording: Recording) -> str:
    """Result of the flight in one line."""
    if not recording.phases:
        return "the recording ends before the flight begins"
    last = recording.phases[-1]
    if recording.plan is None:
        return f"recording cut short during: {last.activity}"
    if last.phase == "DONE" and not last.trouble:
        return "mission complete"
    return f"{last.activity}: {last.trouble}" if last.trouble else last.activity


def recorded_s(recording: Recording) -> float:
    """Time from the first recorded tick to the last, s."""
    ticks = recording.ticks
    return ticks[-1].now_s - ticks[0].now_s if ticks else 0.0


def beam_uses(recording: Recording) -> list[BeamUse]:
    """Shares of reading states, for each range sensor in the recording."""
    counts: dict[Beam, dict[RangeState, int]] = {}
    for tick in recording.ticks:
        for beam, reading in tick.inputs.scan.readings.items():
            mine = counts.setdefault(beam, {})
            mine[reading.state] = mine.get(reading.state, 0) + 1
    return [
        BeamUse(beam, {state: count / sum(mine.values()) for state, count in mine.items()})
        for beam, mine in counts.items()
    ]


def walls_mapped(plan: FloorPlan) -> tuple[float, float]:
    """Length of all walls, m, and their mean sigma by length, m."""
    length_m = sum(wall.length_m for wall in plan.walls)
    return length_m, sum(wall.length_m * wall.sigma_m for wall in plan.walls) / (length_m or 1.0)


def flown_m(plan: FloorPlan) -> float:
    """Horizontal length of the path, m."""
    places = [pose.ne_m for pose in plan.path]
    return sum(math.dist(*leg) for leg in pairwise(places))


def outline_seen(plan: FloorPlan) -> float:
    """Share of directions from take-off in which the map has a wall, 0 to 1."""
    return outline_closed(plan.walls, (0.0, 0.0))


def walls_over_time(plan: FloorPlan) -> tuple[Array, Array]:
    """Times, s, and the share of the final walls that beams had detected by then, 0 to 1."""
    pieces = [_samples(wall) for wall in plan.walls]
    if not pieces or not plan.hits:
        return np.empty(0), np.empty(0)
    hits = np.array([hit.position_ned_m[:2] for hit in plan.hits])
    hit_s = np.array([hit.time_s for hit in plan.hits])
    near = cKDTree(hits).query_ball_point(np.concatenate(pieces), MET_WITHIN_M)
    met_s = np.sort([hit_s[indices].min() for indices in near if indices])
    return met_s, np.arange(1, len(met_s) + 1) / len(near)


def _samples(wall: WallSegment) -> Array:
    """Points along a wall, (n, 2), north and east, m."""
    share = np.linspace(0, 1, max(2, round(wall.length_m / SAMPLE_M)))[:, None]
    points: Array = (1 - share) * wall.start_ne_m + share * np.array(wall.end_ne_m)
    return points
