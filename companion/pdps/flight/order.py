"""Defines an order: one step of a script, which the flight executes."""

import enum
import math

from companion.core.frames import Vector2
from companion.core.messages import HOLD, Setpoint
from companion.core.values import value


class Task(enum.Enum):
    """Tasks of a script, executed one by one."""

    WAIT = "wait"
    TAKE_OFF = "take off"
    SCAN = "scan"
    FLY_TO = "fly to a place"
    FLY_VELOCITY = "fly at a velocity"
    HOME = "return to the start"
    LAND = "land"


@value
class Target:
    """Place to fly to, local NED, with the height and the heading over it."""

    ne_m: Vector2
    height_m: float | None = None
    """Height above the take-off point; None: that of the map."""
    yaw_rad: float | None = None
    """Heading, clockwise from north; None: any."""


@value
class Order:
    """One step of a script; a higher number is a new step, which replaces the one before."""

    number: int = 0
    task: Task = Task.WAIT
    mission: str = ""
    """Mission of a scan; empty: that of the configuration."""
    target: Target | None = None
    """Target of FLY_TO."""
    velocity: Setpoint = HOLD
    """Velocity of FLY_VELOCITY."""
    until_s: float = math.inf
    """Time of the flight at which FLY_TO has failed, and FLY_VELOCITY is over, s."""
    renews: bool = False
    """FLY_VELOCITY: it continues the order before, and does not begin again what was refused."""
