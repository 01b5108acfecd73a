"""What goes between the page and the process that flies: orders one way, news the other."""

from dataclasses import dataclass

from companion.core.messages import FloorPlan
from companion.view.snapshot import Snapshot
from sitl.core.truth import TrueState
from sitl.scoring.report import Report
from sitl.view.request import FlightRequest


@dataclass(frozen=True, slots=True)
class Begin:
    """Fly this; a flight that is under way is given up."""

    flight: int
    """Its number, by which its news are known."""
    request: FlightRequest
    speed: float
    """Times real time."""


@dataclass(frozen=True, slots=True)
class GiveUp:
    """The flight is of no interest any more."""


@dataclass(frozen=True, slots=True)
class Pace:
    """How quickly time passes; 0 is a pause."""

    speed: float


@dataclass(frozen=True, slots=True)
class Step:
    """While it pauses, one tick of the companion."""


@dataclass(frozen=True, slots=True)
class Land:
    """The companion is asked to end its flight."""


@dataclass(frozen=True, slots=True)
class TakeOver:
    """The pilot's mode switch, and his throttle stick: "low" or "mid"."""

    mode: str
    throttle: str = "low"


@dataclass(frozen=True, slots=True)
class Inject:
    """Something goes wrong, by its name in `faults.FAULTS`; None: for good."""

    fault: str
    beam: str
    for_s: float | None


Order = Begin | GiveUp | Pace | Step | Land | TakeOver | Inject


@dataclass(frozen=True, slots=True)
class Seen:
    """One moment, from both sides."""

    flight: int
    snapshot: Snapshot
    truth: TrueState
    clearance_m: float
    """The least so far."""
    collisions: int
    battery: float
    """0 to 1."""


@dataclass(frozen=True, slots=True)
class Refused:
    """An order that cannot be carried out, in one line."""

    reason: str


@dataclass(frozen=True, slots=True)
class Ended:
    """The flight is over, and its map is finished."""

    flight: int
    ending: str
    plan: FloorPlan
    report: Report


News = Seen | Refused | Ended
