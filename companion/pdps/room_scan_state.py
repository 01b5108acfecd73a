"""What the tracing of a room remembers."""

import enum
import math

from companion.core.frames import Vector2
from companion.core.values import value
from companion.navigation.swing import TO_THE_RIGHT, Swing
from companion.pdps.perpendicular import TurnReading


class ScanPhase(enum.Enum):
    """Where in the diagram of `room_scan.py`."""

    TURN = "turning 360° to find the nearest wall"
    SEEK = "flying forward until a wall returns"
    FACE = "facing the wall"
    STAND_OFF = "taking stand-off"
    SCAN = "scanning parallel to the wall"
    CORNER = "turning at a corner"
    SWEEP = "looking along the wall"
    BLOCKED = "something stands at the wall"
    CLOSED = "all walls traced"


@value
class Mark:
    """Where the scan was."""

    ne_m: Vector2
    heading_rad: float
    corners: int
    """Turned until then."""


@value
class RoomScan:
    """The scan's whole memory."""

    phase: ScanPhase = ScanPhase.TURN
    turned_rad: float = 0.0
    last_yaw_rad: float | None = None
    turn: tuple[TurnReading, ...] = ()
    heading_rad: float = 0.0
    standoff_m: float = 0.0
    """As planned for the drone as it flies by now, but no more than"""
    most_standoff_m: float = math.inf
    """the first turn has shown that it may back away."""
    faced_s: float = math.inf
    """When it began to take that."""
    marks: tuple[Mark, ...] = ()
    """The way along the walls so far."""
    corners: int = 0
    swing: Swing = TO_THE_RIGHT
    corner_readings: int = 0
    corner_ne_m: Vector2 = (0.0, 0.0)
    """Where it turns: as far from the next wall as it keeps off this one."""
    sweep_rad: tuple[float, ...] = ()
    """Headings still to be turned to."""
    swept_ne_m: Vector2 | None = None
    """Where it began to look along the wall the last time."""
    extra_rounds: int = 0
    """Begun since all walls were traced once."""

    @property
    def is_extra(self) -> bool:
        """What goes on is not worth the last battery."""
        return self.extra_rounds > 0

    @property
    def activity(self) -> str:
        """The phase in words."""
        return "going round again" if self.is_extra else str(self.phase.value)
