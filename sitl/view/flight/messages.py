"""Messages between the page and the process that flies: orders one way, news the other."""

from collections.abc import Mapping
from dataclasses import dataclass

from companion.core.messages import FloorPlan
from companion.view.snapshot import Snapshot
from sitl.core.truth import TrueState
from sitl.view.request import FlightRequest


@dataclass(frozen=True, slots=True)
class Begin:
    """Start a flight; a running one is cancelled."""

    flight: int
    """Number of the flight; its news have the same number."""
    request: FlightRequest
    speed: float
    """Factor of real time."""


@dataclass(frozen=True, slots=True)
class GiveUp:
    """Cancel the flight."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Set the speed of time; 0 pauses."""

    speed: float


@dataclass(frozen=True, slots=True)
class Step:
    """Advance by one tick of the companion during a pause."""


@dataclass(frozen=True, slots=True)
class Land:
    """Request every companion to end its flight."""


@dataclass(frozen=True, slots=True)
class Inject:
    """Carry out an action of `sitl.testing` on one drone, from 0."""

    drone: int
    action: str
    arguments: Mapping[str, object]


Order = Begin | GiveUp | Pace | Step | Land | Inject


@dataclass(frozen=True, slots=True)
class SeenDrone:
    """One drone: its companion's snapshot and the truth."""

    snapshot: Snapshot
    truth: TrueState
    clearance_m: float
    """Smallest clearance so far, m."""
    collisions: int


@dataclass(frozen=True, slots=True)
class Seen:
    """One moment of all drones."""

    flight: int
    time_s: float
    """Time of the flight, s."""
    drones: tuple[SeenDrone, ...]


@dataclass(frozen=True, slots=True)
class Refused:
    """An order was rejected; the reason in one line."""

    reason: str


@dataclass(frozen=True, slots=True)
class Ended:
    """The flight of the last drone has ended; the final map."""

    flight: int
    endings: tuple[str, ...]
    """Of each drone."""
    plan: FloorPlan
    drones: tuple[int, ...]
    """Number of the drone, from 0, of each path in `plan`; the map is in the frame of the first."""


News = Seen | Refused | Ended
