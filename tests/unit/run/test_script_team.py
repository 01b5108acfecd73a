"""Tests what a script knows of its team."""

import pytest

from companion import connect
from companion.core.messages import RangeScan
from companion.pdps.flight.state import FlightState
from companion.ticks import Outputs, Progress
from tests.unit.team.rooms import PADS, Member

TEAM = {
    "team.name": "test",
    "team.drone": 2,
    "team.pads": [pad.model_dump() for pad in PADS],
    "mission.kind": "building",
}


def test_a_script_sees_the_teammates_that_are_heard() -> None:
    """The drone of the script stands at 1 m north, 0.5 m east of the first, and looks east."""
    drone = connect(settings=TEAM)
    assert not drone.teammates
    own, first = Member(2, 0), Member(1, 0)
    team = drone._flight.app.team
    assert team is not None
    team.mates.hear(1.0, first.tell(1.0), lambda: own.walls, own.grid.grid)
    drone._flight.tick(outputs(1.0))
    [mate] = drone.teammates
    assert (mate.drone, mate.phase, mate.battery) == (1, "exploring", 0.8)
    assert mate.ne_m == pytest.approx((-0.5, 1.0))
    drone._flight.tick(outputs(60.0))
    assert not drone.teammates


def test_a_drone_that_flies_alone_has_no_teammates() -> None:
    drone = connect()
    drone._flight.tick(outputs(1.0))
    assert not drone.teammates


def outputs(time_s: float) -> Outputs:
    progress = Progress(time_s, "", "", tuple)
    return Outputs(None, None, None, progress, FlightState(), RangeScan(time_s, {}))
