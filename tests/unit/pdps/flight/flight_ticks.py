"""States of a flight and inputs of one tick, for tests of the flight's phases."""

import math
from dataclasses import replace

from companion.config.settings import MissionConfig
from companion.core.messages import (
    Beam,
    CommandKind,
    Fault,
    LandedState,
    Pose,
    RangeReading,
    RangeState,
    VehicleState,
)
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray, Rays
from companion.navigation.observation import Observation
from companion.pdps.flight.phases import step
from companion.pdps.flight.state import FlightAction, FlightState, Phase, TickInput

PLAN = MissionConfig()
ON_GROUND = VehicleState(
    connected=True,
    silent_s=0.1,
    mode="STABILIZE",
    landed_state=LandedState.ON_GROUND,
    estimate_ready=True,
)
FLYING = replace(
    ON_GROUND, mode="GUIDED", in_offboard_mode=True, armed=True, landed_state=LandedState.IN_AIR
)
CLEAR = RangeReading(RangeState.DISTANCE, 3.0, 0.01)
UNSEEN_FLOOR = Heights(0.0)
SPACE = Occupancy()
SPACE.draw(
    Rays.of(3 * [Ray((1.0, 1.0), math.radians(n), 4.0, 0.0, False, 0.0) for n in range(360)])
)
"""Free space within the range of one turn."""


def view(
    vehicle: VehicleState = FLYING,
    *,
    time_s: float = 100.0,
    height_m: float = PLAN.height_m,
    position: tuple[float, float] = (1.0, 1.0),
    right: RangeReading = CLEAR,
    up: RangeReading = CLEAR,
    gyro_at_rest: bool = True,
    fault: Fault | None = None,
    land_requested: bool = False,
    floor: Heights = UNSEEN_FLOOR,
) -> TickInput:
    ranges = {Beam.FRONT: CLEAR, Beam.RIGHT: right, Beam.LEFT: CLEAR, Beam.UP: up}
    observation = Observation(Pose(time_s, *position, -height_m, 0.0), ranges, mount_offset_m=0.0)
    return TickInput(
        time_s,
        vehicle,
        observation,
        SPACE,
        floor,
        gyro_at_rest,
        fault,
        land_requested=land_requested,
    )


def flying(phase: Phase) -> FlightState:
    return FlightState(phase, since_s=99.0, began_s=90.0)


def after(phase: Phase, seen: TickInput) -> tuple[Phase, FlightAction]:
    flight, action = step(flying(phase), seen, PLAN)
    return flight.phase, action


def asks(action: FlightAction) -> CommandKind | None:
    return action.command.kind if action.command else None


SILENT = Fault("the gyro is silent", 1.0)
