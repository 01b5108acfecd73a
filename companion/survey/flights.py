"""Flights of a survey: each solved alone, placed in the map, and solved together."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from companion.app import App
from companion.core.arrays import Array, Indices
from companion.core.errors import SurveyError
from companion.estimation.association.pruning import Support
from companion.estimation.hypotheses.search import most_likely
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import NO_WALL, FlightRecord
from companion.estimation.smoothing.joint import PlacedFlight, joined
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import YAW, Measured, Unknowns, project
from companion.pdps.frontiers import Places
from companion.survey.changes import contradicted_shares
from companion.survey.evidence import Sight

MAX_START_SIGMAS = 3.0
"""Largest deviation of a start from the pad, in sigmas. Chosen."""
MAX_LOST_SHARE = 0.1
"""Share of a flight's hits that fit a wall alone, but not in the joint map, above which the flight
is left out. Chosen."""
MAX_CONTRADICTED_SHARE = 0.25
"""Share of a flight's hits on walls that other flights passed through, above which the flight is
left out. Chosen: 0.15 where a door was shut and a cupboard moved in a room of 26 m², 0.4 to 0.5
where a flight began elsewhere."""


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight to merge: its measurements, its solution alone, and the space that it saw."""

    name: str
    models: Models
    record: FlightRecord
    m: Measured
    knows_earlier_flights: bool
    """It began with the map of earlier flights, in their frame."""
    x: Unknowns
    """The flight solved alone."""
    wall_of: Indices
    """(n,): wall of each hit in `x`, or NO_WALL."""
    rays: tuple[Array, ...]
    """(r, 8) for each layer from the lowest, as in `RedrawnGrid.rays`."""
    ceiling_m: float | None
    tried: tuple[tuple[Places, ...], ...]
    """Targets of its looks in each layer, also of those in the flights that it knows."""
    overhead: Array
    """(n, 4), m: readings of the up beam in its own frame, as in `Overhead.readings`."""
    heights: Array
    """(n, 3), m: readings of the down beam in its own frame, as in `Heights.readings`."""

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
        if not alone.wall_of.size:
            raise SurveyError(f"{name}: the drone measured no wall; leave this recording out")
        return cls(
            name,
            estimator.models,
            estimator.record,
            m,
            estimator.knows_earlier_flights,
            alone.x,
            alone.wall_of,
            app.rays,
            app.floor_plan().ceiling_m,
            app.flight.looked_at,
            app.overhead.readings,
            app.heights.readings,
        )

    @property
    def explained(self) -> float:
        """Share of its hits on walls when solved alone."""
        return float((self.wall_of != NO_WALL).mean())

    def sight(self) -> Sight:
        """Its walls and beams, in its own frame."""
        return _sight(self.x, self.m, self.models, self.wall_of)


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A flight that is not part of the map, and why."""

    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Placed:
    """A flight with its start in the map, to be solved together with others."""

    flown: Flown
    x: Unknowns
    """Its solution alone, in the frame of the map."""
    expected: Array
    """(3,): start that is expected: north, east, m, and heading, rad."""
    sigma: Array
    """(3,): its sigmas in the joint solution."""
    is_found: bool = False
    """Only its walls and its free space say where it began."""


@dataclass(frozen=True, slots=True)
class Joint:
    """Flights solved together, in the frame of the first."""

    placed: tuple[Placed, ...]
    models: Models
    m: Measured
    estimate: Estimate

    @classmethod
    def of(cls, placed: Sequence[Placed]) -> "Joint":
        """Solve the flights together."""
        models = _models([each.flown.models for each in placed])
        smoother = Smoother(models, Support())
        flights = [
            PlacedFlight(
                each.flown.m,
                each.x,
                each.expected,
                each.sigma,
                each.flown.models.rest_bias_rad_s,
            )
            for each in placed
        ]
        m, x, prior = joined(smoother, flights)
        return cls(tuple(placed), models, m, most_likely(smoother, x, m, prior))

    def start(self, number: int) -> Array:
        """(3,): solved start of a flight."""
        start: Array = self.estimate.x.poses[self.m.begins[number], : YAW + 1]
        return start

    def lost_share(self, number: int) -> float:
        """Share of a flight's hits that fit a wall alone, but not in this map."""
        wall_of = self.estimate.wall_of[self.m.hit_flight == number]
        return self.placed[number].flown.explained - float((wall_of != NO_WALL).mean())

    def sight(self, without: int | None = None) -> Sight:
        """Walls and beams of all flights, or of all but one."""
        wall_of = self.estimate.wall_of
        if without is not None:
            wall_of = np.where(self.m.hit_flight == without, NO_WALL, wall_of)
        return _sight(self.estimate.x, self.m, self.models, wall_of)


def worst_misfit(joint: Joint, first: int = 1) -> tuple[int, str] | None:
    """Number of the flight that fits worst, and why it does not fit; None if all fit.

    Only flights from number `first` on. The first of all defines the frame, so it always fits.
    """
    misfits: list[tuple[float, int, str]] = []
    estimate = joint.estimate
    contradicted = contradicted_shares(
        estimate.x, joint.m, estimate.wall_of, joint.models.ranges
    ).tolist()
    for number, each in enumerate(joint.placed[first:], first):
        lost = joint.lost_share(number)
        if not each.is_found:
            off = joint.start(number) - each.expected
            off_sigmas = float(np.abs(off / each.sigma).max())
            if off_sigmas > MAX_START_SIGMAS:
                misfits.append(
                    (off_sigmas / MAX_START_SIGMAS, number, off_the_pad(off, each.sigma))
                )
        if lost > MAX_LOST_SHARE:
            reason = f"{100 * lost:.0f} % of its ranges contradict the map of the others"
            misfits.append((lost / MAX_LOST_SHARE, number, reason))
        if contradicted[number] > MAX_CONTRADICTED_SHARE:
            share = contradicted[number]
            reason = f"{100 * share:.0f} % of its walls contradict the free space of the others"
            misfits.append((share / MAX_CONTRADICTED_SHARE, number, reason))
    if not misfits:
        return None
    _, number, reason = max(misfits)
    return number, reason


def off_the_pad(off: Array, sigma: Array) -> str:
    """Why a flight that began `off` (3,) from where it is known to begin is left out."""
    north_m, east_m, yaw_rad = off.tolist()
    most_m, _, most_rad = (MAX_START_SIGMAS * sigma).tolist()
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


def _sight(x: Unknowns, m: Measured, models: Models, wall_of: Indices) -> Sight:
    sigma_m = models.ranges.sigma_m(m.beam, m.distance_m)
    return Sight.of(x, project(x, m), sigma_m, wall_of)
