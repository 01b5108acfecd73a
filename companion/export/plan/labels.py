"""What the files of a map say and show that the map does not contain."""

from dataclasses import dataclass, field

from companion.core.frames import Place
from companion.core.messages import FloorPlan
from companion.export.plan.drawing import Contents
from companion.export.plan.turned import Up, up_rad


@dataclass(frozen=True, slots=True)
class Labels:
    """Title block and contents of the drawings, and the geographic origin."""

    title: str
    place: Place | None = None
    """Where the flight began; None if that is not known."""
    heading_rad: float | None = None
    """True heading at take-off; None if it is not known."""
    unfinished: str = ""
    """Why the map is not finished; empty if it is."""
    up: Up = Up.WALLS
    """What is up on the paper."""
    contents: Contents = field(default_factory=Contents)

    def up_rad(self, plan: FloorPlan) -> float:
        """Heading, in the map's frame, of what is up on the paper."""
        return up_rad(plan, self.up, self.heading_rad or 0.0)
