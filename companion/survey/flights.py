"""Flights of a survey: each solved alone, placed in the map, and solved together."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from companion.app import App
from companion.core.arrays import Array
from companion.core.errors import SurveyError
from companion.core.messages import FloorPlan
from companion.estimation.association.pruning import Support
from companion.estimation.estimator import Estimator
from companion.estimation.hypotheses.search import most_likely
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.joint import PlacedFlight, joined
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import YAW, Measured, Unknowns, project
from companion.mapping.redrawn_grid import RedrawnGrid
from companion.pdps.frontiers import Places
from companion.survey.evidence import Sight

MAX_START_SIGMAS = 3.0
"""Largest deviation of a start from the pad, in sigmas. Chosen."""
MAX_LOST_SHARE = 0.1
"""Share of a flight's hits that fit a wall alone, but not in the joint map, above which the flight
is left out. Chosen."""


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

    @property
    def explained(self) -> float:
        """Share of its hits on walls when solved alone."""
        return float((self.alone.wall_of != NO_WALL).mean())

    def sight(self) -> Sight:
        """Its walls and beams, in its own frame."""
        return _sight(self.alone, self.m, self.estimator.models)


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
        models = _models([each.flown.estimator.models for each in placed])
        smoother = Smoother(models, Support())
        flights = [
            PlacedFlight(
                each.flown.m,
                each.x,
                each.expected,
                each.sigma,
                each.flown.estimator.models.rest_bias_rad_s,
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
        return _sight(self.estimate, self.m, self.models, without)


def worst_misfit(joint: Joint, first: int = 1) -> tuple[int, str] | None:
    """Number of the flight that fits worst, and why it does not fit; None if all fit.

    Only flights from number `first` on. The first of all defines the frame, so it always fits.
    """
    misfits: list[tuple[float, int, str]] = []
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


def _sight(estimate: Estimate, m: Measured, models: Models, without: int | None = None) -> Sight:
    """Walls and beams of a solution, of all its flights or of all but one."""
    wall_of = estimate.wall_of
    if without is not None:
        wall_of = np.where(m.hit_flight == without, NO_WALL, wall_of)
    sigma_m = models.ranges.sigma_m(m.beam, m.distance_m)
    return Sight.of(estimate.x, project(estimate.x, m), sigma_m, wall_of)
