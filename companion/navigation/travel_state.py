"""Defines the state of a journey to one goal (`travel.py`)."""

import enum
import math
from dataclasses import dataclass, replace
from itertools import pairwise

from companion.core.frames import Vector2
from companion.navigation.doorways import Doorway
from companion.navigation.grid_planner import START_NE_M
from companion.navigation.path_follower import ARRIVED_M, Course, Way
from companion.navigation.sweep import Sweep


class TravelPhase(enum.Enum):
    """States of the diagram in `travel.py`."""

    FLY = "on the way"
    SWEEP = "looking for the way"
    WITHDRAW = "withdrawing from obstacles too near to measure"
    ARRIVED = "arrived"
    GAVE_UP = "no way"


@dataclass(frozen=True, slots=True)
class Travel:
    """State of a journey to one goal. Positions are local NED, m."""

    goal_ne_m: Vector2
    within_m: float = ARRIVED_M
    """Arrival radius, m, in the open and after the course was swept. In a narrow place the radius
    is `ARRIVED_M`, or the nearest that the drone gets."""
    phase: TravelPhase = TravelPhase.FLY
    way: Way = ()
    """The path still to fly."""
    course: Course | None = None
    """Course to the next corner; None until a beam has pointed along it."""
    planned_s: float = -math.inf
    checked_s: float = -math.inf
    """Times at which the path was planned and last checked."""
    resets: int = 0
    """Reset counter of the pose at the last check. A step of the pose moves the map."""
    doorways: tuple[Doorway, ...] = ()
    """Doorways on the path, in its order."""
    known: tuple[Doorway, ...] = ()
    """All doorways found so far."""
    shut: tuple[Doorway, ...] = ()
    """Places that paths must avoid: doorways and others where the drone was stuck."""
    stuck_at: tuple[Doorway, ...] = ()
    """Places where the drone was stuck, on all journeys so far."""
    sweep: Sweep | None = None
    """The sweep in progress, in SWEEP."""
    roomy_ne_m: Vector2 | None = None
    """Last place with room to turn round."""
    looked_round: bool = False
    """True after the turn all round, which is done once, if there is no path."""
    withdrew: bool = False
    """True after the withdrawal from obstacles too near to measure, which is done once."""
    waits_at_ne_m: Vector2 | None = None
    """Place where the drone waits until a teammate has passed the doorway ahead."""
    waits_since_s: float = math.inf
    """Time since which the doorway ahead is another drone's, s."""
    progress_s: float | None = None
    progress_ne_m: Vector2 = (0.0, 0.0)
    """Time and place of the last progress."""

    def left_m(self, here_ne_m: Vector2) -> float:
        """Length of the path still to fly, m."""
        return sum(math.dist(start, end) for start, end in pairwise((here_ne_m, *self.way)))

    def rested(self) -> "Travel":
        """The journey after a pause: the time without progress begins anew."""
        return replace(self, progress_s=None)

    @property
    def goes_home(self) -> bool:
        """True if the goal is the start. Then fewer places are treated as blocked."""
        return self.goal_ne_m == START_NE_M


def onward(before: Travel | None, goal_ne_m: Vector2, within_m: float) -> Travel:
    """A journey to the next goal, with the doorways and stuck places of the journey before."""
    if before is None:
        return Travel(goal_ne_m, within_m)
    return Travel(
        goal_ne_m,
        within_m,
        course=before.course,
        known=before.known,
        shut=stuck_twice(before),
        stuck_at=before.stuck_at,
        roomy_ne_m=before.roomy_ne_m,
    )


def stuck_twice(travel: Travel) -> tuple[Doorway, ...]:
    """Places where the drone was stuck twice. Once may have been a person in the way."""
    places = travel.stuck_at
    return tuple(at for i, at in enumerate(places) if any(map(at.is_same, places[:i])))
