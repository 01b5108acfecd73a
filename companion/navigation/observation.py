"""Defines the observation: the pose and sensor data of one tick, the input of every manoeuvre."""

import math
from collections.abc import Callable, Mapping
from dataclasses import field

from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.known_walls import KnownWalls
from companion.core.messages import (
    BEARING_FRD_RAD,
    FIRST_LAG_S,
    Beam,
    Pose,
    RangeReading,
    RangeState,
)
from companion.core.values import value
from companion.mapping.occupancy import Occupancy
from companion.safety.separation import KeepOut
from companion.safety.swept_space import Lane, all_swept


@value
class Claim:
    """What a teammate goes to look at, in this drone's frame."""

    places_ne_m: tuple[Vector2, ...]
    arrives_in_s: float
    """Time until it can see them, s."""
    is_extra: bool
    """The mission is complete without it."""
    comes_first: bool
    """Of two drones that arrive at the same time, it goes on."""
    from_ne_m: Vector2
    """Where the teammate is."""


@value
class Tracing:
    """A teammate that traces the walls of the same room, in this drone's frame."""

    ne_m: Vector2
    wall_rad: float | None
    """Bearing of the perpendicular to the wall at which it begins, rad; None: not chosen yet."""
    side: int
    """1: it goes round clockwise, -1: counter-clockwise, 0: not chosen yet."""
    is_flying: bool
    is_tracing: bool
    """It goes along the walls now."""
    track_ne_m: Array
    """(m, 2): where it has been along the walls."""
    comes_first: bool


@value
class DoorwayClaim:
    """The doorway in which a teammate is, or to which it comes next."""

    middle_ne_m: Vector2
    at_ne_m: Vector2
    """Where the teammate is."""
    comes_first: bool
    goes_home: bool = False
    """It has no part of the mission any more."""

    @property
    def away_m(self) -> float:
        """Distance of the teammate from the middle of the doorway, m."""
        return math.dist(self.at_ne_m, self.middle_ne_m)


@value
class LayerClaim:
    """The layer of a teammate in the air."""

    number: int
    """From the lowest, which is 0."""
    comes_first: bool


@value
class TeamLayers:
    """What a drone of a team knows of the layers."""

    claims: tuple[LayerClaim, ...]
    seen: frozenset[int]
    """Layers that were seen, by what the teammates say."""
    space: Callable[[int], Occupancy]
    """Returns the joined map of a layer."""
    flown_ne_m: Callable[[int], Array]
    """Returns the places (n, 2) of a layer that the teammates have flown over."""


@value
class Observation:
    """Pose, range readings and the mapped wall ahead, at one tick."""

    pose: Pose
    ranges: Mapping[Beam, RangeReading]
    mount_offset_m: float
    """Distance from the drone's centre to the sensors, m."""
    standoff_m: float = 1.5
    """Planned distance from the drone's centre to the scanned wall, m."""
    bearings_frd_rad: Mapping[Beam, float] = field(default_factory=lambda: BEARING_FRD_RAD)
    """Bearings of the level beams, body frame (FRD), rad."""
    wall_ahead: tuple[float, float] | None = None
    """Bearing of the perpendicular to the mapped wall that the nose points at, rad, and the
    distance along it, m."""
    walls: Callable[[], KnownWalls] = KnownWalls.none
    """All mapped walls; computed only when called."""

    lag_s: float = FIRST_LAG_S
    """Lag of the vehicle's velocity behind the setpoint, s."""
    wander_m: float = 0.0
    """Drift of the autopilot's position estimate, one sigma, m."""
    lane: Callable[[float], Lane] = all_swept
    """The part of the path towards a bearing (FRD, rad) that the beams have swept."""
    is_among_legs: bool = False
    """True if a thin obstacle that stands alone was detected lately."""
    legs: int = 0
    """Number of such obstacles detected in this flight."""
    is_gap_doubtful: bool = False
    """True if the drone has stayed near an obstacle that it cannot measure there, for so long that
    it may have drifted against it (`obstacle_memory.py`)."""

    is_in_team: bool = False
    """True if a teammate has told what it has seen."""
    explorers_ne_m: tuple[Vector2, ...] = ()
    """Where the teammates are that explore, and do not wait."""
    claims: tuple[Claim, ...] = ()
    """What the teammates go to look at."""
    tracings: tuple[Tracing, ...] = ()
    """Teammates that trace the same room."""
    doorway_claims: tuple[DoorwayClaim, ...] = ()
    """Doorways of the teammates at the same height."""
    keep_outs: tuple[KeepOut, ...] = ()
    """Teammates near the drone round which its path leads."""
    goes_home: bool = False
    """True in a team if this drone has no part of the mission any more."""
    waits_for_radio: bool = False
    """True in a team if a teammate with the right of way is in the air, and not heard."""
    home_by_s: float = math.inf
    """Time at which the drone must be home, s: then a teammate flies on that does not hear it."""
    is_contradicted: bool = False
    """True in a team if the drone must land because its map contradicts those of others."""
    team_layers: TeamLayers | None = None
    """None for a drone that flies alone, and in other missions."""

    def clear_m(self, beam: Beam) -> float:
        """Free distance from the drone's centre along a beam, m.

        Infinite if the beam measures no obstacle in range; 0 without a valid reading.
        """
        reading = self.ranges.get(beam)
        if reading is None:
            return 0.0
        if not math.isnan(reading.distance_m):
            return reading.distance_m + self.mount_offset_m
        return math.inf if reading.state is RangeState.NOTHING else 0.0
