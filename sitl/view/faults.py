"""Lists the faults that the page can inject: actions of `sitl.testing` by name."""

import math
from collections.abc import Callable

from companion.core.frames import frd_to_ned
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.action import Action
from sitl.testing.actions.link import link_down
from sitl.testing.actions.sensors import break_bus, hang_bus, unplug
from sitl.testing.actions.surroundings import somebody
from sitl.testing.actions.vehicle import crash

AHEAD_M = 1.8
"""Distance of a person ahead of the drone, m. Chosen."""
HEAD_M = 1.2
"""Height of that person if the drone is on the ground, m. Chosen."""


def _in_the_way(simulation: Simulation, beam: str, for_s: float | None) -> Action:
    """A person appears in front of the drone."""
    truth = simulation.autopilot.truth
    north_m, east_m = frd_to_ned(AHEAD_M, 0.0, truth.yaw_rad)
    north, east, down = truth.position_ned_m
    height_m = -down if math.isfinite(down) and down < 0 else HEAD_M
    return somebody([(north + north_m, east + east_m, height_m)], for_s)


FAULTS: dict[str, Callable[[Simulation, str, float | None], Action]] = {
    "link down": lambda simulation, beam, for_s: link_down(for_s),
    "sensor bus fails": lambda simulation, beam, for_s: break_bus(for_s),
    "sensor bus hangs": lambda simulation, beam, for_s: hang_bus(for_s=for_s),
    "sensor unplugged": lambda simulation, beam, for_s: unplug(beam),
    "somebody in the way": _in_the_way,
    "crash": lambda simulation, beam, for_s: crash(),
}
"""Actions by the name on the page."""
