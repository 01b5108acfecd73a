"""What the flight remembers, what it is told at a tick, and what it asks for."""

import enum
import math
from dataclasses import field, replace

from companion.core.messages import Command, Fault, Order, Setpoint, VehicleState
from companion.core.values import value
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.navigation.energy_reserve import Reserve
from companion.navigation.grid_planner import START_NE_M
from companion.navigation.observation import Observation
from companion.navigation.travel_state import Travel
from companion.pdps.explore import Explore
from companion.pdps.layers import Layers
from companion.pdps.room_scan_state import RoomScan
from companion.safety.obstacle_memory import Surroundings

HEARTBEAT_S = 1.0
LINK_LOST_S = 10.0


class Phase(enum.Enum):
    """Where in the diagram of `phases.py`."""

    CONNECT = "waiting for the autopilot"
    PREPARE = "waiting for gyro rest and a usable estimate"
    OFFBOARD = "asking to be followed"
    ARM = "arming"
    TAKE_OFF = "taking off"
    ROOM = "scanning the room"
    BUILDING = "exploring the building"
    LAYERS = "exploring layer by layer"
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
FINAL_PHASES = frozenset({Phase.DONE, Phase.HANDED_OVER, Phase.FAILED})
UNARMED_PHASES = frozenset({Phase.CONNECT, Phase.PREPARE, Phase.OFFBOARD, Phase.ARM})
FLYING_PHASES = frozenset(
    {
        *(Phase.TAKE_OFF, *MISSION_PHASES.values()),
        *(Phase.HOME, Phase.DIVERT, Phase.DESCEND, Phase.HOVER, Phase.HOLD),
    }
)
LEVEL_PHASES = FLYING_PHASES - {Phase.TAKE_OFF, Phase.HOLD}
"""In these the height is kept and every velocity is guarded."""


@value
class TickInput:
    """What the flight knows at one tick."""

    time_s: float
    vehicle: VehicleState
    observation: Observation
    space: Occupancy
    floor: Heights
    gyro_at_rest: bool
    """The gyro's bias has been averaged."""
    fault: Fault | None = None
    """What is not well."""
    around: Surroundings = field(default_factory=Surroundings)
    land_requested: bool = False
    """The user or the operating system asks the program to end."""
    order: Order | None = None
    """A script's; None: the whole mission is flown."""
    starved: str = ""
    """Why the computer has no time to fly; or nothing."""


@value
class FlightState:
    """The flight's whole memory."""

    phase: Phase = Phase.CONNECT
    since_s: float = math.inf
    """Start of the phase; the first starts with the first tick, whatever the clock says then."""
    began_s: float = 0.0
    room: RoomScan = field(default_factory=RoomScan)
    building: Explore = field(default_factory=Explore)
    layers: Layers = field(default_factory=Layers)
    reserve: Reserve = Reserve()
    way_home: Travel = Travel(START_NE_M)
    lost_since_s: float = math.inf
    lost_s: float = -math.inf
    """When it first, and last, found no way home."""
    diversion: Travel | None = None
    """To where it lands, if not at its start,"""
    diverted_s: float = math.inf
    """and since when it has looked for such a place."""
    arrived_s: float = 0.0
    """When it came home."""
    held_from: Phase = Phase.CONNECT
    held_trouble: str = ""
    """Phase and trouble to go back to when the fault is gone."""
    trouble: str = ""
    """Why the drone holds, lands early, was handed over or failed; empty if all went well."""
    notice: str = ""
    """What the pilot is to know; told whenever it changes."""
    mode_before: str = ""
    """The mode out of which ours was asked for."""
    is_others: bool = False
    """Somebody else has armed it: nothing of ours is to touch it."""
    up_since_s: float = math.inf
    """Since when it has been at its height, before it says that it is in the air."""
    land_mode_seen: bool = False
    obeyed: int = 0
    """The number of the last order that was taken up."""

    @property
    def completed(self) -> bool:
        return self.phase is Phase.DONE and not self.trouble

    @property
    def took_off(self) -> bool:
        return self.began_s > 0

    @property
    def ending(self) -> str:
        """How the flight ended, in words."""
        if self.completed:
            return "mission complete"
        return f"{self.phase.value}: {self.trouble}" if self.trouble else self.phase.value

    @property
    def activity(self) -> str:
        """The phase in words, as fine as it is known."""
        parts = {
            Phase.ROOM: self.room.activity,
            Phase.BUILDING: self.building.activity,
            Phase.LAYERS: self.layers.activity,
        }
        return str(parts.get(self.phase, self.phase.value))


@value
class FlightAction:
    """What to ask of the autopilot at this tick."""

    setpoint: Setpoint | None = None
    command: Command | None = None


NOTHING = FlightAction()


def go(
    flight: FlightState, phase: Phase, view: TickInput, trouble: str | None = None
) -> FlightState:
    reason = flight.trouble if trouble is None else trouble
    return replace(flight, phase=phase, since_s=view.time_s, trouble=reason)


def age_s(flight: FlightState, view: TickInput) -> float:
    return view.time_s - flight.since_s


def hand_over(flight: FlightState, view: TickInput) -> FlightState:
    """Somebody else has the drone: nothing more is sent.

    It may be the autopilot itself, which lands when setpoints come too late.
    """
    gave_back = view.vehicle.in_offboard_mode
    trouble = "mode changed for a moment" if gave_back else f"mode changed to {view.vehicle.mode}"
    late = f"; {view.starved}" if view.starved else ""
    return go(flight, Phase.HANDED_OVER, view, trouble + late)


def after(planned: Phase, view: TickInput) -> Phase:
    """What follows: as planned, or whatever a script will order."""
    return planned if view.order is None else Phase.HOVER
