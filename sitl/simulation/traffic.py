"""Simulates other vehicles in the same world, as obstacles and for beams."""

import math
from collections.abc import Callable, Sequence
from random import Random

from companion.core.frames import Vector3
from sitl.core.truth import TrueState
from sitl.sensors.beam import RangeQuery
from sitl.world.geometry.model import BODY_RADIUS_M

JET_M_S = 0.25
"""Speed at which a vehicle directly below another one sinks, m/s. Assumed: a few percent of the
air's speed in the jet, because the velocity controller works against it. The jet is twice as fast
as the air in the rotors, v = √(m·g / (2·ρ·A)) = 4.5 m/s for 0.9 kg on four rotors of 24 cm
(momentum theory)."""
JET_RADIUS_M, JET_LENGTH_M = 0.3, 2.0
"""Radius of the jet, and distance over which it slows down to 1/e, m. Assumed: half the width of
the vehicle with its rotors."""
FACING_COS = math.cos(math.radians(5))
"""Two infrared sensors see each other's light within this angle of both beams. Assumed: the width
of the emitted beam."""
LEVEL_AXES_RAD = tuple(math.radians(degrees) for degrees in (0, 90, -90))
"""Bearings of a vehicle's front, right and left beam."""
Bodies = Callable[[], Sequence[Vector3]]
"""Returns the positions of bodies, world NED, m."""
Others = Callable[[], Sequence[TrueState]]
"""Returns the states of the other vehicles."""


def no_others() -> Sequence[TrueState]:
    """No other vehicles."""
    return ()


def clearance_to_others_m(position: Vector3, others: Sequence[Vector3]) -> float:
    """Distance between the bodies, m; ≤ 0 on contact, infinite without others."""
    nearest_m = min((math.dist(position, other) for other in others), default=math.inf)
    return nearest_m - 2 * BODY_RADIUS_M


def downwash_m_s(position: Vector3, others: Sequence[Vector3]) -> float:
    """Speed at which the air of vehicles above pushes a vehicle down, m/s."""
    pushed_m_s = 0.0
    north, east, down = position
    for other_north, other_east, other_down in others:
        below_m = down - other_down
        if below_m > 0:
            aside_m = math.hypot(north - other_north, east - other_east)
            share = math.exp(-((aside_m / JET_RADIUS_M) ** 2) - below_m / JET_LENGTH_M)
            pushed_m_s += JET_M_S * share
    return pushed_m_s


def with_crosstalk(query: RangeQuery, others: Others, random: Random) -> RangeQuery:
    """Range of an infrared sensor that other vehicles' sensors dazzle.

    Where two sensors face each other, each triangulates the light of the other, and measures any
    shorter distance.
    """

    def range_m(origin: Vector3, direction: Vector3, most_m: float) -> float | None:
        measured_m = query(origin, direction, most_m)
        for other in others():
            away_m = _to_body_m(origin, direction, other.position_ned_m)
            is_met = measured_m is not None and away_m <= measured_m + 1e-9
            if is_met and _faces(other, direction):
                return random.uniform(0.0, away_m)
        return measured_m

    return range_m


def _faces(other: TrueState, direction: Vector3) -> bool:
    """True if one of a vehicle's level beams points against a direction (unit vector)."""
    axes = (other.yaw_rad + axis_rad for axis_rad in LEVEL_AXES_RAD)
    return any(
        -(direction[0] * math.cos(axis) + direction[1] * math.sin(axis)) > FACING_COS
        for axis in axes
    )


def with_others(walls: RangeQuery, others: Bodies) -> RangeQuery:
    """Range to the nearest surface: a wall, or the body of another vehicle."""

    def range_m(origin: Vector3, direction: Vector3, most_m: float) -> float | None:
        bodies = others()
        if not bodies:
            return walls(origin, direction, most_m)
        to_bodies = (_to_body_m(origin, direction, body) for body in bodies)
        nearest_m = min((d for d in to_bodies if d <= most_m), default=math.inf)
        to_wall_m = walls(origin, direction, most_m)
        if to_wall_m is not None and to_wall_m <= nearest_m:
            return to_wall_m
        return nearest_m if nearest_m < math.inf else None

    return range_m


def _to_body_m(origin: Vector3, direction: Vector3, body: Vector3) -> float:
    """Distance along a unit ray to a sphere; infinite if it misses or starts inside."""
    off = [b - o for b, o in zip(body, origin, strict=True)]
    along = sum(x * d for x, d in zip(off, direction, strict=True))
    inside2 = BODY_RADIUS_M**2 - (sum(x * x for x in off) - along**2)
    if inside2 < 0:
        return math.inf
    distance_m = along - math.sqrt(inside2)
    return distance_m if distance_m >= 0 else math.inf
