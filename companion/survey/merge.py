"""Merges flights from the same pad into one map.

Each flight is solved alone first. A flight that knew the map of earlier ones lies in their frame;
another one is placed by its walls (`placement.py`). Then all flights are solved together
(`estimation/smoothing/joint.py`). A flight that does not fit, because it began elsewhere or the
building has changed, is left out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from companion.app import App
from companion.core.arrays import Array, Indices
from companion.core.errors import SurveyError
from companion.core.messages import FloorPlan, Hit, Pose, WallLine
from companion.earlier import EarlierFlights
from companion.estimation.association.pruning import Support
from companion.estimation.estimator import Estimator
from companion.estimation.hypotheses.search import most_likely
from companion.estimation.smoothing.estimate import EarlierWalls, Estimate
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.joint import PAUSE_S, PlacedFlight, joined, moved_to
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import YAW, Measured, Unknowns
from companion.estimation.solved_flight import SolvedFlight
from companion.mapping.floor_plan import wall_segments
from companion.mapping.occupancy import Occupancy
from companion.mapping.redrawn_grid import RedrawnGrid
from companion.pdps.frontiers import Places
from companion.survey.placement import refined_start

MAX_START_SIGMAS = 3.0
"""Largest deviation of a start from the pad, in sigmas. Chosen."""
MAX_LOST_SHARE = 0.1
"""Share of a flight's hits that fit a wall alone, but not in the joint map, above which the flight
is left out. Chosen."""
MIN_SHARED_HITS = 20
"""Least hits of a flight on a wall that it shares with another flight. Chosen."""


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight to merge: its estimator at the end, its map, and the space that its beams saw."""

    name: str
    estimator: Estimator
    plan: FloorPlan
    space: RedrawnGrid
    tried: tuple[Places, ...]
    """Targets of its looks, also of those in the flights that it knows."""
    m: Measured
    alone: Estimate
    """The flight solved alone."""

    @classmethod
    def of(cls, name: str, app: App) -> "Flown":
        """Solve a flight that has ended.

        Raises:
            SurveyError: the drone did not fly, or the flight cannot be solved.
        """
        estimator = app.estimator
        if estimator is None or len(estimator.record.frames) < 2:
            raise SurveyError(f"{name}: the drone did not fly; leave this recording out")
        try:
            m, alone = estimator.solved()
        except np.linalg.LinAlgError as error:
            raise SurveyError(f"{name}: cannot be solved ({error}); leave it out") from None
        tried = tuple(look.at_ne_m for look in app.flight.building.tried)
        return cls(name, estimator, app.floor_plan(), app.space, tried, m, alone)


@dataclass(frozen=True, slots=True)
class MergedFlight:
    """Where a flight began, and how well the other flights confirm it."""

    name: str
    start: Array
    """(3,): north, east, m, and heading, rad, of its start in the frame of the first flight."""
    shared_walls: int
    """Walls that it and at least one other flight detected."""
    later_s: float
    """Time in the joint map less time in its recording, s."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A flight that is not part of the map, and why."""

    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Merged:
    """The joint map, in the frame of the first flight."""

    plan: FloorPlan
    flights: tuple[MergedFlight, ...]
    left_out: tuple[LeftOut, ...]
    estimate: Estimate
    space: Occupancy
    tried: tuple[Places, ...]

    def for_next_flight(self, pad_sigma: Array) -> EarlierFlights:
        """What a new flight from the pad has to know; `pad_sigma` as in `merge`."""
        x, solution = self.estimate.x, self.estimate.solution
        of_walls = slice(x.calibration.size, None)
        covariance = solution.shared_covariance[of_walls, of_walls]
        walls = EarlierWalls(x.walls, x.reach_m, covariance, pad_sigma)
        return EarlierFlights(walls, self.space.of_earlier_flight(), self.plan.walls, self.tried)


@dataclass(frozen=True, slots=True)
class _Placed:
    """A flight to solve together with others."""

    flown: Flown
    flight: PlacedFlight
    explained: float
    """Share of its hits on walls when solved alone."""


def merge(flown: Sequence[Flown], pad_sigma: Array) -> Merged:
    """Solve the flights together; a flight that does not fit is left out.

    `pad_sigma` (3,): sigmas of where a flight begins on the pad: north, east, m, and heading, rad.
    """
    placed, left_out = _placed(flown, pad_sigma)
    while True:
        m, estimate = _solved_together(placed)
        misfit = _worst_misfit(placed, m, estimate, pad_sigma)
        if misfit is None:
            flights = [each.flown for each in placed]
            return _merged(flights, m, estimate, tuple(left_out))
        number, reason = misfit
        left_out.append(LeftOut(placed.pop(number).flown.name, reason))


def _solved_together(placed: Sequence[_Placed]) -> tuple[Measured, Estimate]:
    models = _models([each.flown.estimator.models for each in placed])
    smoother = Smoother(models, Support())
    m, x, prior = joined(smoother, [each.flight for each in placed])
    return m, most_likely(smoother, x, m, prior)


def _worst_misfit(
    placed: Sequence[_Placed], m: Measured, estimate: Estimate, pad_sigma: Array
) -> tuple[int, str] | None:
    """Number of the flight that fits worst, and why it does not fit; None if all fit.

    The first flight defines the frame, so it always fits.
    """
    misfits: list[tuple[float, int, str]] = []
    for number, each in enumerate(placed[1:], 1):
        start = estimate.x.poses[m.begins[number], : YAW + 1]
        explained = float((estimate.wall_of[m.hit_flight == number] != NO_WALL).mean())
        lost = each.explained - explained
        off_sigmas = float(np.abs(start / pad_sigma).max())
        if off_sigmas > MAX_START_SIGMAS:
            misfits.append((off_sigmas / MAX_START_SIGMAS, number, _off_the_pad(start, pad_sigma)))
        if lost > MAX_LOST_SHARE:
            reason = f"{100 * lost:.0f} % of its ranges contradict the map of the others"
            misfits.append((lost / MAX_LOST_SHARE, number, reason))
    if not misfits:
        return None
    _, number, reason = max(misfits)
    return number, reason


def _placed(flown: Sequence[Flown], pad_sigma: Array) -> tuple[list[_Placed], list[LeftOut]]:
    """The flights, each placed by its walls in the map of those before; and those off the pad."""
    placed: list[_Placed] = []
    left_out: list[LeftOut] = []
    known: Unknowns | None = None
    for each in flown:
        m, solved, x = each.m, each.alone, each.alone.x.since(0)
        if each.estimator.knows_earlier_flights:
            detected = np.unique(solved.wall_of[solved.wall_of != NO_WALL])
            x.keep_walls(detected, solved.wall_of)
        elif known is not None:
            start = refined_start(x, known, np.zeros(3), pad_sigma)
            if (np.abs(start) > MAX_START_SIGMAS * pad_sigma).any():
                left_out.append(LeftOut(each.name, _off_the_pad(start, pad_sigma)))
                continue
            x = moved_to(x, start)
        if known is None:
            known = x.since(0)
        else:
            known.add_walls(x.walls, x.reach_m)
        bias = each.estimator.models.rest_bias_rad_s
        explained = float((solved.wall_of != NO_WALL).mean())
        placed.append(_Placed(each, PlacedFlight(m, x, np.zeros(3), pad_sigma, bias), explained))
    return placed, left_out


def _off_the_pad(start: Array, pad_sigma: Array) -> str:
    north_m, east_m, yaw_rad = start.tolist()
    most_m, _, most_rad = (MAX_START_SIGMAS * pad_sigma).tolist()
    return (
        f"it fits best {100 * math.hypot(north_m, east_m):.0f} cm and "
        f"{abs(math.degrees(yaw_rad)):.0f}° off the pad; at most {100 * most_m:.0f} cm and "
        f"{math.degrees(most_rad):.0f}° are allowed"
    )


def _models(models: Sequence[Models]) -> Models:
    """Models of all flights: those of the first, with the noisiest odometry."""
    noisiest = max((each.odometry for each in models), key=lambda odometry: odometry.wander_m)
    walk = max(each.odometry.step_variance_m2_per_s for each in models)
    return replace(models[0], odometry=replace(noisiest, step_variance_m2_per_s=walk))


def _merged(
    flown: Sequence[Flown], m: Measured, estimate: Estimate, left_out: tuple[LeftOut, ...]
) -> Merged:
    x, lines = estimate.x, estimate.wall_lines
    flights = [_of_one(number, each, m, estimate, lines) for number, each in enumerate(flown)]
    space = Occupancy()
    for each, flight in zip(flown, flights, strict=True):
        each.space.draw_onto(space, flight.poses)
    walls = wall_segments(
        lines,
        np.concatenate([flight.points_ne_m for flight in flights]),
        np.concatenate([flight.wall_of for flight in flights]),
    )
    hits: list[Hit] = []
    path: list[Pose] = []
    later_s = 0.0
    begins_s: list[float] = []
    for flight in flights:
        begins_s.append(later_s)
        hits += [replace(hit, time_s=hit.time_s + later_s) for hit in flight.hits()]
        path += [replace(pose, time_s=pose.time_s + later_s) for pose in flight.path()]
        later_s = path[-1].time_s + PAUSE_S
    ceilings = [each.plan.ceiling_m for each in flown if each.plan.ceiling_m is not None]
    floors = [each.plan.floor_m for each in flown if each.plan.floor_m is not None]
    plan = FloorPlan(
        walls,
        tuple(hits),
        tuple(path),
        float(np.median(ceilings)) if ceilings else None,
        float(np.median(floors)) if floors else None,
        tuple(top for each in flown for top in each.plan.tops),
    )
    shared = _shared_walls([flight.wall_of for flight in flights], len(lines))
    starts = [x.poses[begin, : YAW + 1] for begin in m.begins]
    return Merged(
        plan,
        tuple(
            MergedFlight(each.name, start, count, begin_s)
            for each, start, count, begin_s in zip(flown, starts, shared, begins_s, strict=True)
        ),
        left_out,
        estimate,
        space,
        _tried(flown),
    )


def _tried(flown: Sequence[Flown]) -> tuple[Places, ...]:
    """Targets of all looks, each once: a flight that knew earlier flights has theirs, too."""
    return tuple(dict.fromkeys(places for each in flown for places in each.tried))


def _of_one(
    number: int, flown: Flown, m: Measured, estimate: Estimate, lines: tuple[WallLine, ...]
) -> SolvedFlight:
    """One flight of the joint solution."""
    x = estimate.x
    frames = slice(m.begins[number], (*m.begins, len(x.poses))[number + 1])
    own = replace(x, poses=x.poses[frames], calibration=x.calibration[[number]])
    wall_of = estimate.wall_of[m.hit_flight == number]
    units = flown.estimator.models.ranges
    return SolvedFlight.of(flown.estimator.record, own, lines, wall_of, units)


def _shared_walls(wall_of: Sequence[Indices], walls: int) -> list[int]:
    """Number of walls that each flight shares with another."""
    has_hits = np.array(
        [np.bincount(each[each != NO_WALL], minlength=walls) >= MIN_SHARED_HITS for each in wall_of]
    )
    is_shared = has_hits.sum(axis=0) > 1
    return [int((each & is_shared).sum()) for each in has_hits]
