"""What the files of a map say and show that the map does not contain."""

from dataclasses import dataclass, field

from companion.core.frames import Place
from companion.export.plan.drawing import Contents
from companion.export.plan.turned import Up


@dataclass(frozen=True, slots=True)
class Labels:
    """Title block and contents of the drawings, and the geographic origin."""

    title: str
    place: Place | None = None
    """Where the flight began; None if that is not known."""
    heading_rad: float = 0.0
    """True heading at take-off."""
    unfinished: str = ""
    """Why the map is not finished; empty if it is."""
    up: Up = Up.WALLS
    """What is up on the paper."""
    contents: Contents = field(default_factory=Contents)
