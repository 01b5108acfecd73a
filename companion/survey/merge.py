"""Merges flights into one map.

Each flight is solved alone first. A flight that knew the map of earlier ones lies in their frame.
The walls of another one place it in the map, near the pad (`known_start.py`) or anywhere
(`start_search.py`). All flights are solved together (`estimation/smoothing/joint.py`). A flight
that does not fit, because it began elsewhere or the building has changed, is left out; so is one
whose start is ambiguous.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, zip_longest

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import (
    inverse_starts,
    places_moved_to,
    points_to_frd,
    poses_moved_to,
)
from companion.core.messages import FloorPlan, Hit, Pose, WallLine
from companion.earlier import SURVEY_PAD, EarlierFlights
from companion.estimation.smoothing.estimate import EarlierWalls, Estimate
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.joint import PAUSE_S
from companion.estimation.smoothing.state import (
    WALL_SIZE,
    YAW,
    Measured,
    Unknowns,
    project,
    reach_m,
)
from companion.estimation.solved_flight import SolvedFlight
from companion.mapping.floor_plan import wall_segments
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.mapping.redrawn_grid import draw_onto
from companion.pdps.frontiers import Places
from companion.survey.changes import Change, changes
from companion.survey.flights import Flown, Joint, LeftOut, Placed
from companion.survey.known_start import solved_from_pad
from companion.survey.start_search import Placing

MIN_SHARED_HITS = 20
"""Least hits of a flight on a wall that it shares with another flight. Chosen."""


@dataclass(frozen=True, slots=True)
class MergedFlight:
    """Where a flight began, and how well the other flights confirm it."""

    name: str
    start: Array
    """(3,): north, east, m, and heading, rad, of its start in the frame of the first flight."""
    pad: Array | None
    """(3,): where it was known to begin; None if its walls alone placed it."""
    shared_walls: int
    """Walls that it and at least one other flight detected."""
    later_s: float
    """Time in the joint map less time in its recording, s."""
    rays: tuple[Array, ...]
    """(r, 8) for each layer from the lowest, as in `RedrawnGrid.rays`."""
    poses: Array
    """(k, 3): its solved keyframes."""

    @property
    def off_the_pad(self) -> Array:
        """(3,): its start less that of its pad, or less that of the first flight without a pad."""
        return self.start if self.pad is None else self.start - self.pad


@dataclass(frozen=True, slots=True)
class Merged:
    """The joint map, in the frame of the first flight."""

    plan: FloorPlan
    flights: tuple[MergedFlight, ...]
    left_out: tuple[LeftOut, ...]
    estimate: Estimate
    reach_m: Array
    """(w, 2): interval of each wall's hits; empty for walls that are gone."""
    tried: tuple[tuple[Places, ...], ...]
    """As in `EarlierFlights`, in the frame of the first flight."""
    overhead: Array
    """As in `EarlierFlights`, in the frame of the first flight."""
    changes: tuple[Change, ...] = ()
    """What has changed between the flights."""

    def flight_of(self, time_s: Sequence[float]) -> list[int]:
        """Number of the flight, from 0, at each time of the joint map."""
        begins_s = [flight.later_s for flight in self.flights[1:]]
        numbers: list[int] = np.searchsorted(begins_s, time_s, side="right").tolist()
        return numbers

    def for_next_flight(self, pad_sigma: Array, pad: Array = SURVEY_PAD) -> EarlierFlights:
        """What a new flight from a pad (3,) has to know; `pad_sigma` as in `Starts`."""
        x, solution = self.estimate.x, self.estimate.solution
        stay = np.flatnonzero(self.reach_m[:, 0] <= self.reach_m[:, 1])
        rows = x.calibration.size + (WALL_SIZE * stay[:, None] + np.arange(WALL_SIZE)).ravel()
        covariance = solution.shared_covariance[np.ix_(rows, rows)]
        walls = EarlierWalls(x.walls[stay], self.reach_m[stay], covariance, pad_sigma)
        [origin] = inverse_starts(pad[None])
        overhead = self.overhead.copy()
        overhead[:, :YAW] = places_moved_to(origin, overhead[:, :YAW])
        tried = tuple(_moved(layer, origin) for layer in self.tried)
        return EarlierFlights(walls.moved_to(origin), self._spaces(origin), tried, overhead, pad)

    def _spaces(self, origin: Array) -> tuple[Occupancy, ...]:
        """The space of each layer, drawn in a frame in which that of the map begins at `origin`."""
        spaces = tuple(Occupancy() for _ in range(max(len(each.rays) for each in self.flights)))
        for flight in self.flights:
            poses = poses_moved_to(origin, flight.poses)
            for space, rays in zip(spaces, flight.rays, strict=False):
                draw_onto(space, rays, poses)
        return tuple(space.of_earlier_flight() for space in spaces)


@dataclass(frozen=True, slots=True)
class Starts:
    """What is known of where the flights began."""

    pad_sigma: Array
    """(3,): sigmas of a known start: north, east, m, and heading, rad."""
    given: Mapping[str, Array] = field(default_factory=dict)
    """(3,) each: known starts of flights that began elsewhere than the first, by name."""
    are_unknown: bool = False
    """The starts of all others are unknown; else they are those of the first."""


def merge(flown: Sequence[Flown], starts: Starts) -> Merged:
    """Solve the flights together; a flight that does not fit is left out."""
    is_known = [
        not starts.are_unknown or each.name in starts.given or each.knows_earlier_flights
        for each in flown
    ]
    is_known[0] = True
    known = [each for each, here in zip(flown, is_known, strict=True) if here]
    joint, left_out = solved_from_pad(known, starts.pad_sigma, starts.given)
    unknown = [each for each, here in zip(flown, is_known, strict=True) if not here]
    joint, not_placed = Placing(joint, unknown).run()
    return _merged(joint, (*left_out, *not_placed))


def _merged(joint: Joint, left_out: tuple[LeftOut, ...]) -> Merged:
    m, x, lines = joint.m, joint.estimate.x, joint.estimate.wall_lines
    found = changes(x, m, joint.estimate.wall_of, joint.models.ranges)
    flown = [each.flown for each in joint.placed]
    flights = [
        _of_one(number, each, m, x, (lines, found.wall_of)) for number, each in enumerate(flown)
    ]
    walls = wall_segments(
        lines,
        np.concatenate([flight.points_ne_m for flight in flights]),
        np.concatenate([flight.wall_of for flight in flights]),
    )
    hits: list[Hit] = []
    path: list[Pose] = []
    later_s = 0.0
    begins_s: list[float] = []
    begins: list[int] = []
    for flight in flights:
        begins_s.append(later_s)
        begins.append(len(path))
        hits += [replace(hit, time_s=hit.time_s + later_s) for hit in flight.hits()]
        path += [replace(pose, time_s=pose.time_s + later_s) for pose in flight.path()]
        later_s = path[-1].time_s + PAUSE_S
    ceilings = [each.ceiling_m for each in flown if each.ceiling_m is not None]
    starts = [joint.start(number) for number in range(len(flown))]
    heights = Heights(0.0)
    for each, start in zip(flown, starts, strict=True):
        heights.know(_in_map(each.heights, each, start))
    plan = FloorPlan(
        walls,
        tuple(hits),
        tuple(path),
        float(np.median(ceilings)) if ceilings else None,
        heights.floor_m,
        heights.tops(),
        tuple(begins),
    )
    shared = _shared_walls([flight.wall_of for flight in flights], len(lines))
    return Merged(
        plan,
        tuple(
            MergedFlight(
                each.flown.name,
                start,
                None if each.is_found else each.expected,
                count,
                begin_s,
                each.flown.rays,
                flight.poses,
            )
            for each, flight, start, count, begin_s in zip(
                joint.placed, flights, starts, shared, begins_s, strict=True
            )
        ),
        left_out,
        joint.estimate,
        reach_m(x, project(x, m).points, found.wall_of),
        _tried(joint.placed, starts),
        np.concatenate(
            [_in_map(each.overhead, each, at) for each, at in zip(flown, starts, strict=True)]
        ),
        found.listed,
    )


def _tried(placed: Sequence[Placed], starts: Sequence[Array]) -> tuple[tuple[Places, ...], ...]:
    """Targets of all looks in each layer, each once: later flights have those of earlier ones.

    A flight that knew those of earlier ones has them in the frame of its pad.
    """
    in_map = (
        [
            _moved(layer, each.expected if each.flown.knows_earlier_flights else start)
            for layer in each.flown.tried
        ]
        for each, start in zip(placed, starts, strict=True)
    )
    by_layer = zip_longest(*in_map, fillvalue=())
    return tuple(tuple(dict.fromkeys(chain.from_iterable(layer))) for layer in by_layer)


def _moved(tried: tuple[Places, ...], start: Array) -> tuple[Places, ...]:
    """The targets of looks, in a frame in which their own begins at `start` (3,)."""
    moved = []
    for places in tried:
        whole_mm = np.round(places_moved_to(start, np.array(places).reshape(-1, 2)), 3)
        moved.append(tuple((north_m, east_m) for north_m, east_m in whole_mm.tolist()))
    return tuple(moved)


def _in_map(readings: Array, flown: Flown, start: Array) -> Array:
    """(n, c): readings of a flight in the frame of the map; the first columns are north and east.

    `start` (3,): where the flight began, as solved.
    """
    own_start = flown.x.poses[0, : YAW + 1]
    readings = readings.copy()
    off_m = points_to_frd(readings[:, :2] - own_start[:YAW], float(own_start[YAW] - start[YAW]))
    readings[:, :2] = start[:YAW] + off_m
    return readings


def _of_one(
    number: int,
    flown: Flown,
    m: Measured,
    x: Unknowns,
    walls: tuple[tuple[WallLine, ...], Indices],
) -> SolvedFlight:
    """One flight of the joint solution. `walls`: all lines, and the line of each hit (n,)."""
    lines, wall_of_all = walls
    frames = slice(m.begins[number], (*m.begins, len(x.poses))[number + 1])
    own = replace(x, poses=x.poses[frames], calibration=x.calibration[[number]])
    wall_of = wall_of_all[m.hit_flight == number]
    return SolvedFlight.of(flown.record, own, lines, wall_of, flown.models.ranges)


def _shared_walls(wall_of: Sequence[Indices], walls: int) -> list[int]:
    """Number of walls that each flight shares with another."""
    has_hits = np.array(
        [np.bincount(each[each != NO_WALL], minlength=walls) >= MIN_SHARED_HITS for each in wall_of]
    )
    is_shared = has_hits.sum(axis=0) > 1
    return [int((each & is_shared).sum()) for each in has_hits]
