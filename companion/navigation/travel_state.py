"""What going to one place remembers."""

import enum
import math
from dataclasses import dataclass

from companion.core.frames import Vector2
from companion.navigation.doorways import Doorway
from companion.navigation.grid_planner import START_NE_M
from companion.navigation.path_follower import ARRIVED_M, Course, Way
from companion.navigation.sweep import Sweep


class TravelPhase(enum.Enum):
    """Where in the diagram of `travel.py`."""

    FLY = "on the way"
    SWEEP = "looking for the way"
    ARRIVED = "arrived"
    GAVE_UP = "no way"


@dataclass(frozen=True, slots=True)
class Travel:
    """The whole memory of going to one place."""

    goal_ne_m: Vector2
    within_m: float = ARRIVED_M
    """So near to it, it has arrived, unless that is in a doorway, or it has not looked there; and
    where it is tight, so near as it gets."""
    phase: TravelPhase = TravelPhase.FLY
    way: Way = ()
    course: Course | None = None
    """To the next corner, once it was faced."""
    planned_s: float = -math.inf
    checked_s: float = -math.inf
    """When the way was found, and when it was last found free."""
    resets: int = 0
    """Of the pose, when the way was looked at: a step of the pose moves the map under the way."""
    doorways: tuple[Doorway, ...] = ()
    known: tuple[Doorway, ...] = ()
    """All doorways found so far."""
    shut: tuple[Doorway, ...] = ()
    """Those that it could not get through, and other places as if they were doorways."""
    stuck_at: tuple[Doorway, ...] = ()
    """The same, of all ways so far."""
    sweep: Sweep | None = None
    """In SWEEP."""
    roomy_ne_m: Vector2 | None = None
    """Where it last had room to turn round."""
    looked_round: bool = False
    """It does so once, when there is no way."""
    progress_s: float | None = None
    progress_ne_m: Vector2 = (0.0, 0.0)
    """When and where it last got on."""

    @property
    def goes_home(self) -> bool:
        """On which it stops before less."""
        return self.goal_ne_m == START_NE_M


def onward(before: Travel | None, goal_ne_m: Vector2, within_m: float) -> Travel:
    """To another place, with what was found on the way so far."""
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
    """Where it was stuck on two ways; somebody may have stood there the first time."""
    places = travel.stuck_at
    return tuple(at for i, at in enumerate(places) if any(map(at.is_same, places[:i])))
