"""Defines the flight's state, its input at each tick, and the action that it returns."""

import enum
import math
from collections.abc import Callable
from dataclasses import field, replace
from itertools import zip_longest

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.messages import Command, Fault, Setpoint, VehicleState
from companion.core.values import value
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.navigation.energy_reserve import Reserve
from companion.navigation.grid_planner import START_NE_M
from companion.navigation.observation import Observation
from companion.navigation.travel_state import Travel
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.flight.fly_to import FlyTo
from companion.pdps.flight.fly_velocity import FlyVelocity
from companion.pdps.flight.order import Order
from companion.pdps.frontiers import Places
from companion.pdps.layers import Layers, LayersPhase
from companion.pdps.room_scan_state import RoomScan
from companion.safety.obstacle_memory import Surroundings
from companion.safety.separation import Passing

HEARTBEAT_S = 1.0
"""Maximum age of the reported mode at which a command is sent in OFFBOARD, s: the period of
HEARTBEAT."""
LINK_LOST_S = 10.0
"""Time without any message, or without HEARTBEAT, after which the flight has failed, s. Chosen."""


class Phase(enum.Enum):
    """States of the diagram in `phases.py`."""

    CONNECT = "waiting for the autopilot"
    PREPARE = "waiting for gyro rest and a usable estimate"
    OFFBOARD = "asking to be followed"
    ARM = "arming"
    TAKE_OFF = "taking off"
    ROOM = "scanning the room"
    BUILDING = "exploring the building"
    LAYERS = "exploring layer by layer"
    FLY_TO = "flying to a place by order"
    FLY_VELOCITY = "flying at a velocity by order"
    HOME = "returning to the start"
    DIVERT = "flying to a place to land"
    DESCEND = "descending"
    HOVER = "waiting for orders"
    HOLD = "holding"
    LAND = "landing"
    DONE = "landed"
    HANDED_OVER = "handed over"
    FAILED = "failed"


MISSION_PHASES = {
    "room": Phase.ROOM,
    "building": Phase.BUILDING,
    "exterior": Phase.BUILDING,
    "layers": Phase.LAYERS,
}
"""Phase of each kind of mission."""
TASK_PHASES = frozenset({*MISSION_PHASES.values(), Phase.FLY_TO, Phase.FLY_VELOCITY})
"""Phases away from the start, which end in time for the path home."""
FINAL_PHASES = frozenset({Phase.DONE, Phase.HANDED_OVER, Phase.FAILED})
"""Phases that end the flight."""
UNARMED_PHASES = frozenset({Phase.CONNECT, Phase.PREPARE, Phase.OFFBOARD, Phase.ARM})
"""Phases before arming."""
FLYING_PHASES = frozenset(
    {
        *(Phase.TAKE_OFF, *TASK_PHASES),
        *(Phase.HOME, Phase.DIVERT, Phase.DESCEND, Phase.HOVER, Phase.HOLD),
    }
)
"""Phases in the air, before LAND."""
COLUMN_PHASES = frozenset({Phase.TAKE_OFF, Phase.DESCEND, Phase.LAND})
"""Phases in which the drone climbs or descends."""
LEVEL_PHASES = FLYING_PHASES - {Phase.TAKE_OFF, Phase.HOLD}
"""Phases with height control, in which the velocity limiter applies."""


@value
class TickInput:
    """Input of one tick of the flight."""

    time_s: float
    vehicle: VehicleState
    observation: Observation
    space: Occupancy
    floor: Heights
    gyro_at_rest: bool
    """True if the gyro's bias has been averaged at rest."""
    fault: Fault | None = None
    """Present fault of a sensor, the link or another part."""
    around: Surroundings = field(default_factory=Surroundings)
    """Recent obstacles, for the velocity limiter."""
    land_requested: bool = False
    """True if the user or the operating system asks the program to end."""
    order: Order | None = None
    """Order of a script; None if the whole mission is flown without one."""
    starved: str = ""
    """Reason why the computer is too slow to fly; empty if it is not."""


@value
class OffLevel:
    """A height other than that of the map, to which a script's order has led."""

    height_m: float
    """Height above the take-off point, which the drone holds while it hovers."""
    from_ne_m: Vector2 | None = None
    """Place at which it returns to the height of the map, local NED, m; None before."""
    since_s: float = math.inf
    """Begin of the return, s."""


@value
class FlightState:
    """State of the flight."""

    phase: Phase = Phase.CONNECT
    since_s: float = math.inf
    """Start of the phase, s. The first phase starts with the first tick."""
    began_s: float = 0.0
    """Time of arming, s; 0 before."""
    room: RoomScan = field(default_factory=RoomScan)
    building: Explore = field(default_factory=Explore)
    layers: Layers = field(default_factory=Layers)
    reserve: Reserve = Reserve()
    way_home: Travel = Travel(START_NE_M)
    lost_since_s: float = math.inf
    lost_s: float = -math.inf
    """Times of the first and the last failed search for a path home, s."""
    diversion: Travel | None = None
    """Journey to a landing site other than the start."""
    diverted_s: float = math.inf
    """Time of the first diversion, s."""
    arrived_s: float = 0.0
    """Time of arrival at home, s."""
    held_from: Phase = Phase.CONNECT
    held_trouble: str = ""
    """Phase and trouble to restore when the fault is gone."""
    trouble: str = ""
    """Reason why the drone holds, lands early, was handed over or failed; empty without one."""
    notice: str = ""
    """Message for the pilot, sent whenever it changes."""
    mode_before: str = ""
    """Flight mode at the time at which the companion's mode was requested."""
    is_others: bool = False
    """True if another party armed the vehicle. Then the companion sends nothing."""
    up_since_s: float = math.inf
    """Time since which the drone is at its height in TAKE_OFF, s."""
    land_mode_seen: bool = False
    """True once the autopilot has reported LAND."""
    passing: Passing | None = None
    """From when the drone climbs to let a teammate pass below, until it is down again."""
    holds_at_ne_m: Vector2 | None = None
    """Place at which the drone holds until it hears its teammates, local NED, m."""
    obeyed: int = 0
    """Number of the last executed order."""
    fly_to: FlyTo | None = None
    """Flight to a place, in FLY_TO."""
    fly_velocity: FlyVelocity | None = None
    """Flight at a velocity, in FLY_VELOCITY."""
    off_level: OffLevel | None = None
    """None at the height of the map."""
    undone: str = ""
    """Reason why the last executed order was not completed; empty without one."""

    @property
    def completed(self) -> bool:
        """True if the flight ended without trouble."""
        return self.phase is Phase.DONE and not self.trouble

    @property
    def took_off(self) -> bool:
        """True after arming."""
        return self.began_s > 0

    @property
    def ending(self) -> str:
        """Description of how the flight ended."""
        if self.completed:
            return "mission complete"
        return f"{self.phase.value}: {self.trouble}" if self.trouble else self.phase.value

    @property
    def unfinished(self) -> str:
        """Why the mission was not completed; empty if it was."""
        return "" if self.completed else self.ending

    @property
    def waits(self) -> bool:
        """True while the drone waits for others, and lets them pass."""
        explores = self.explores
        is_waiting = (
            explores is not None and explores.phase is ExplorePhase.WAIT and explores.travel is None
        )
        chooses = self.phase is Phase.LAYERS and self.layers.phase is LayersPhase.CHOOSE
        is_at_doorway = self.travel is not None and self.travel.waits_at_ne_m is not None
        return is_waiting or chooses or is_at_doorway or self.phase in (Phase.HOVER, Phase.HOLD)

    @property
    def travel(self) -> Travel | None:
        """The present journey, if the drone is on one."""
        if self.phase is Phase.HOME:
            return self.way_home
        if self.phase is Phase.DIVERT:
            return self.diversion
        if self.phase is Phase.FLY_TO and self.fly_to is not None:
            return self.fly_to.travel
        if self.phase is Phase.LAYERS and self.layers.phase is LayersPhase.RETURN:
            return self.layers.travel
        return self.explores.travel if self.explores else None

    def rested(self) -> "FlightState":
        """The state after a pause: the time without progress of each journey begins anew."""
        return replace(
            self,
            holds_at_ne_m=None,
            building=self.building.rested(),
            layers=replace(
                self.layers,
                explore=self.layers.explore.rested(),
                travel=self.layers.travel.rested(),
            ),
            way_home=self.way_home.rested(),
            diversion=self.diversion and self.diversion.rested(),
            fly_to=self.fly_to and self.fly_to.rested(),
        )

    @property
    def explores(self) -> Explore | None:
        """The present exploration, of a building or of a layer."""
        if self.phase is Phase.BUILDING:
            return self.building
        is_layer = self.phase is Phase.LAYERS and self.layers.phase is LayersPhase.EXPLORE
        return self.layers.explore if is_layer else None

    @property
    def is_to_be_continued(self) -> bool:
        """True if it has landed before the mission was complete; another flight can go on."""
        return self.phase is Phase.DONE and not self.completed

    @property
    def looked_at(self) -> tuple[tuple[Places, ...], ...]:
        """Targets of all looks in each layer, from the lowest."""
        by_layer = zip_longest((self.building.tried,), self.layers.all_looked, fillvalue=())
        return tuple(tuple(look.at_ne_m for each in layer for look in each) for layer in by_layer)

    @property
    def activity(self) -> str:
        """Description of the phase, or of the mission's own phase during a mission."""
        if self.holds_at_ne_m is not None:
            return "holding: a teammate is not heard"
        parts = {
            Phase.ROOM: self.room.activity,
            Phase.BUILDING: self.building.activity,
            Phase.LAYERS: self.layers.activity,
        }
        if self.fly_to is not None:
            parts[Phase.FLY_TO] = self.fly_to.activity
        return str(parts.get(self.phase, self.phase.value))


@value
class FlightAction:
    """Setpoint and command for the autopilot at this tick."""

    setpoint: Setpoint | None = None
    command: Command | None = None


NOTHING = FlightAction()
"""No setpoint and no command."""
PhaseStep = Callable[[FlightState, TickInput, MissionConfig], tuple[FlightState, FlightAction]]
"""Runs one tick of a phase: the next state, and the action that it asks for."""


def go(
    flight: FlightState, phase: Phase, view: TickInput, trouble: str | None = None
) -> FlightState:
    """Enters a phase. None as `trouble` keeps the present one."""
    reason = flight.trouble if trouble is None else trouble
    return replace(flight, phase=phase, since_s=view.time_s, trouble=reason)


def age_s(flight: FlightState, view: TickInput) -> float:
    """Time in the present phase, s."""
    return view.time_s - flight.since_s


def hand_over(flight: FlightState, view: TickInput) -> FlightState:
    """Ends the flight because the pilot or the autopilot has control. Nothing more is sent.

    The autopilot also takes control itself: it lands when setpoints arrive too late.
    """
    gave_back = view.vehicle.in_offboard_mode
    trouble = "mode changed for a moment" if gave_back else f"mode changed to {view.vehicle.mode}"
    late = f"; {view.starved}" if view.starved else ""
    return go(flight, Phase.HANDED_OVER, view, trouble + late)


def after(planned: Phase, view: TickInput) -> Phase:
    """The next phase: as planned, or HOVER if a script gives the orders."""
    return planned if view.order is None else Phase.HOVER
