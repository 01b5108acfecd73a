"""Defines the state of the room scan (`room_scan.py`)."""

import enum
import math
from dataclasses import replace

from companion.core.frames import Vector2, ned_to_frd, wrap_rad
from companion.core.messages import Beam
from companion.core.values import value
from companion.navigation.swing import TO_THE_RIGHT, Swing
from companion.pdps.perpendicular import TurnReading

CORNERS_OF_A_ROOM = 4
"""Minimum number of corners in a round."""
CLOSING_OVERLAP_M, CLOSING_WITHIN_M = 0.3, 1.5
"""The round is closed if the drone is past a mark of the round before by the first distance, and
within the second of it, m. Chosen."""
CLOSING_RAD = math.radians(20)
"""Maximum difference in heading to that mark, rad. Chosen."""
MARK_EVERY_M = 0.5
"""Spacing of the marks on the track, m. Chosen."""


class ScanPhase(enum.Enum):
    """States of the diagram in `room_scan.py`."""

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
    """A place on the scan's track."""

    ne_m: Vector2
    heading_rad: float
    corners: int
    """Number of corners turned before."""


@value
class RoomScan:
    """State of the scan. Positions are local NED, m."""

    phase: ScanPhase = ScanPhase.TURN
    turned_rad: float = 0.0
    """Angle turned so far, in TURN, rad."""
    last_yaw_rad: float | None = None
    turn: tuple[TurnReading, ...] = ()
    """Readings of the first turn."""
    side: int = 1
    """1: the drone moves to its right, and traces the room clockwise; -1: to its left."""
    heading_rad: float = 0.0
    """Heading at a right angle to the wall, rad."""
    standoff_m: float = 0.0
    """Planned stand-off distance, limited to `most_standoff_m`, m."""
    most_standoff_m: float = math.inf
    """Maximum stand-off, m: the first turn measured free space so far from the wall."""
    faced_s: float = math.inf
    """Time at which STAND_OFF began, s."""
    marks: tuple[Mark, ...] = ()
    """The track along the walls so far."""
    corners: int = 0
    """Number of corners turned."""
    swing: Swing = TO_THE_RIGHT
    corner_readings: int = 0
    """Number of consecutive readings that show a corner."""
    corner_ne_m: Vector2 = (0.0, 0.0)
    """Place of the turn, at the stand-off from both walls."""
    sweep_rad: tuple[float, ...] = ()
    """Headings still to turn to, in SWEEP, rad."""
    swept_ne_m: Vector2 | None = None
    """Place of the last sweep."""
    extra_rounds: int = 0
    """Rounds begun since all walls were traced once."""

    def marked(self, here_ne_m: Vector2) -> "RoomScan":
        """The scan with a mark at this place, if the last one is far enough away."""
        if self.marks and math.dist(self.marks[-1].ne_m, here_ne_m) < MARK_EVERY_M:
            return self
        mark = Mark(here_ne_m, self.heading_rad, self.corners)
        return replace(self, marks=(*self.marks, mark))

    def is_closed(self, here_ne_m: Vector2) -> bool:
        """True if this place is past a mark of a full round ago, near it, at its heading."""
        for mark in self.marks:
            if self.corners - mark.corners < CORNERS_OF_A_ROOM:
                break
            north_m, east_m = here_ne_m[0] - mark.ne_m[0], here_ne_m[1] - mark.ne_m[1]
            _, along_m = ned_to_frd(north_m, east_m, mark.heading_rad)
            is_past = self.side * along_m > CLOSING_OVERLAP_M
            is_there = is_past and math.hypot(north_m, east_m) < CLOSING_WITHIN_M
            if is_there and abs(wrap_rad(self.heading_rad - mark.heading_rad)) < CLOSING_RAD:
                return True
        return False

    @property
    def ahead(self) -> Beam:
        """The beam that points in the direction of flight along the wall."""
        return Beam.RIGHT if self.side > 0 else Beam.LEFT

    @property
    def is_tracing(self) -> bool:
        """True from the first wall on until all are traced."""
        return self.phase in (ScanPhase.SCAN, ScanPhase.CORNER, ScanPhase.SWEEP)

    @property
    def is_extra(self) -> bool:
        """True in an extra round, which may end early."""
        return self.extra_rounds > 0

    @property
    def activity(self) -> str:
        """Description of the phase."""
        return "going round again" if self.is_extra else str(self.phase.value)
