"""What a ground station on another link of the autopilot receives of a flight, by messages.

QGroundControl draws the vehicle at GLOBAL_POSITION_INT (33), the obstacle ring from
OBSTACLE_DISTANCE (330), and lists STATUSTEXT (253).
"""

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.app import App
from companion.config.settings import Config
from companion.core.messages import Beam
from companion.link.reports import SECTOR_OF, UNKNOWN_SECTOR
from companion.link.transports.transport import Message, direct_pair
from companion.run.hardware import make_rig
from companion.run.loop import ControlLoop
from companion.ticks import Progress
from sitl.sensors.line import on_virtual_time
from sitl.simulation.lockstep import LockstepClock
from sitl.simulation.simulation import Setup, Simulation
from sitl.world.loading import load_world
from tests.worlds import SMALL_ROOM

pytestmark = pytest.mark.flights

PREPARED_S, TAKEN_OFF_S = 6.0, 16.0
"""Times after which the origin is set, and a take-off is over, s."""
BOUNDS_M = (1.0, 5.5)
"""Bounds of the Sharp sensors' ranges, m."""
STATION = 255, 190
"""System and component of the ground station."""
COMPANION = 191
LAT_DEG, LON_DEG, ALT_M = 48.2082, 16.3738, 171.0


class Station:
    """The autopilot's link to a ground station that requests as QGroundControl does."""

    def __init__(self) -> None:
        self.now_s = self._told_s = 0.0
        self.received: dict[str, list[Any]] = defaultdict(list)

    def receive(self) -> list[Message]:
        """Messages to the autopilot, once a second; PX4 needs no request."""
        if self.now_s < self._told_s + 1:
            return []
        self._told_s = self.now_s
        kind, none = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
        position = mavlink.MAV_DATA_STREAM_POSITION
        messages = [
            mavlink.MAVLink_heartbeat_message(kind, none, 0, 0, mavlink.MAV_STATE_ACTIVE, 3),
            mavlink.MAVLink_request_data_stream_message(1, 1, position, 3, 1),
        ]
        for message in messages:
            message._header.srcSystem, message._header.srcComponent = STATION
        return messages

    def send(self, message: Message) -> None:
        self.received[message.get_type()].append(message)

    def close(self) -> None:
        """No resource to release."""


def seen(autopilot: str, link: Mapping[str, object], until_s: float) -> Mapping[str, list[Any]]:
    """The beginning of a flight, and the messages that a ground station beside it receives."""
    place = {"origin_lat_deg": LAT_DEG, "origin_lon_deg": LON_DEG, "origin_alt_m": ALT_M}
    config = Config.model_validate({"link": {**place, **link}})
    setup = Setup(load_world(SMALL_ROOM), SMALL_ROOM, 1, config.sensors, autopilot=autopilot)
    autopilot_end, companion_end = direct_pair()
    station = Station()
    simulation = Simulation(setup, [autopilot_end, station])

    def beside() -> None:
        station.now_s = simulation.time_s

    clock = LockstepClock(simulation, beside)
    rig = make_rig(config, companion_end, on_virtual_time(simulation.board.bus), clock)
    loop = ControlLoop(App(config), rig, _nobody_watches)
    due_s: float | None = 0.0
    while due_s is not None and simulation.time_s < until_s:
        due_s = loop.tick(clock.wait_until(due_s))
    return station.received


def _nobody_watches(progress: Progress) -> None:
    """Ignore the progress."""


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_ground_station_receives_position_obstacle_ring_and_phases(autopilot: str) -> None:
    messages = seen(autopilot, {"tell_ranges": "obstacle_distance"}, TAKEN_OFF_S)
    position = messages["GLOBAL_POSITION_INT"][-1]
    assert (position.lat / 1e7, position.lon / 1e7) == pytest.approx((LAT_DEG, LON_DEG), abs=1e-5)
    assert position.relative_alt / 1000 == pytest.approx(1.2, abs=0.3)
    assert position.alt - position.relative_alt == pytest.approx(1000 * ALT_M, abs=1)
    ring = messages["OBSTACLE_DISTANCE"][-1]
    assert ring.get_srcComponent() == COMPANION
    assert (ring.frame, ring.increment, ring.angle_offset) == (mavlink.MAV_FRAME_BODY_FRD, 5, 0)
    known = {sector for sector, cm in enumerate(ring.distances) if cm != UNKNOWN_SECTOR}
    assert known == {SECTOR_OF[beam] for beam in (Beam.FRONT, Beam.RIGHT, Beam.LEFT)}
    assert (ring.min_distance / 100, ring.max_distance / 100) == BOUNDS_M
    sent = [text.text for text in messages["STATUSTEXT"] if text.get_srcComponent() == COMPANION]
    phases = ["arming", "taking off", "turning 360 deg to find the nearest wall"]
    assert sent[-3:] == [f"PDPS: {phase}" for phase in phases]


def test_no_ring_is_sent_unless_it_is_asked_for() -> None:
    """ArduPilot avoids with it, and limits the velocities that the companion commands."""
    messages = seen("ardupilot", {}, PREPARED_S)
    assert "OBSTACLE_DISTANCE" not in messages
    assert "DISTANCE_SENSOR" not in messages
    assert messages["GLOBAL_POSITION_INT"]
