"""Flies at a velocity by a script's order, until its time is over or the guard refuses it."""

import math
from dataclasses import replace

import numpy as np

from companion.core.arrays import Array
from companion.core.messages import Setpoint
from companion.core.values import value
from companion.pdps.flight.order import Order
from companion.safety.obstacle_memory import Surroundings
from companion.safety.velocity_guard import CRAWL_M_S

MIN_HEIGHT_M = 0.5
"""Lowest height of an order, above the take-off point, m: the lowest of `mission.height_m`."""
REFUSED_SHARE, REFUSED_S = 0.1, 1.0
"""The velocity is refused if for this time, s, less than this share of it is allowed. Chosen: after
a turn, unswept space ahead stops the drone for less."""


@value
class FlyVelocity:
    """State of a flight at a velocity."""

    wanted: Setpoint
    """Velocity of the order."""
    until_s: float
    """Time at which it is over, s."""
    refused_since_s: float = math.inf
    """Time since which almost nothing of it is allowed, s."""

    def renewed(self, order: Order) -> "FlyVelocity":
        """The state with the velocity of a new order."""
        return replace(self, wanted=order.velocity, until_s=order.until_s)

    def setpoint(self, *, is_off_level: bool) -> Setpoint:
        """The velocity to fly. Off the height of the map no beam has swept the space."""
        speed_m_s = math.hypot(self.wanted.forward_m_s, self.wanted.right_m_s)
        if not is_off_level or speed_m_s <= CRAWL_M_S:
            return self.wanted
        share = CRAWL_M_S / speed_m_s
        return replace(
            self.wanted,
            forward_m_s=share * self.wanted.forward_m_s,
            right_m_s=share * self.wanted.right_m_s,
        )

    def see(self, allowed: Setpoint, time_s: float) -> "FlyVelocity":
        """The state with what the limits leave of the velocity at this tick."""
        wanted, left = _frd_m_s(self.wanted), _frd_m_s(allowed)
        is_refused = bool(wanted @ left < REFUSED_SHARE * (wanted @ wanted))
        since_s = min(self.refused_since_s, time_s) if is_refused else math.inf
        return self if since_s == self.refused_since_s else replace(self, refused_since_s=since_s)

    def refusal(self, around: Surroundings, time_s: float) -> str:
        """The reason to stop; empty without one."""
        if time_s - self.refused_since_s <= REFUSED_S:
            return ""
        if not (self.wanted.forward_m_s or self.wanted.right_m_s):
            if self.wanted.down_m_s < 0:
                return "the velocity is refused: the drone needs its clearance to what is above"
            return (
                "the velocity is refused: the drone needs its clearance to what is below, "
                f"and a height of {MIN_HEIGHT_M} m"
            )
        near_m = float(np.hypot(*around.points_frd_m.T).min(initial=math.inf))
        nearest = "" if math.isinf(near_m) else f"; the nearest obstacle is {near_m:.1f} m away"
        return f"the velocity is refused by the velocity guard{nearest}"


def _frd_m_s(setpoint: Setpoint) -> Array:
    return np.array((setpoint.forward_m_s, setpoint.right_m_s, setpoint.down_m_s))
