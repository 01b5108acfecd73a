"""Tests what the page asks of the process that flies, and what it gets, without a flight."""

import pytest

from companion.core.errors import ConfigError
from companion.core.messages import Beam, Sketch
from companion.drivers.models import range_models
from companion.view.snapshot import Snapshot
from sitl.core.truth import TrueState
from sitl.view.flight.messages import Seen, SeenDrone
from sitl.view.flight.outbox import later
from sitl.view.live_score import LiveScore
from sitl.view.request import OWN_PROFILE, FlightRequest
from sitl.view.shown import Shown
from sitl.world.loading import load_world

ROOM = load_world("room_100")
HERE = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)


def moment(time_s: float, *sketches: Sketch | None) -> Seen:
    """A moment of as many drones as there are maps."""
    drones = (
        SeenDrone(Snapshot(time_s, "", sketch=sketch), HERE, 1.0, collisions=0)
        for sketch in sketches
    )
    return Seen(1, time_s, tuple(drones))


def test_a_moment_that_replaces_another_keeps_the_map_of_each_drone() -> None:
    old, new = Sketch(ceiling_m=2.0), Sketch(ceiling_m=3.0)
    merged = later(moment(1.0, old, old), moment(2.0, None, new))
    assert [drone.snapshot.sketch for drone in merged.drones] == [old, new]
    assert [drone.snapshot.time_s for drone in merged.drones] == [2.0, 2.0]


def test_one_drone_flies_alone_and_more_fly_as_a_team() -> None:
    [setup], [config] = FlightRequest("room_100", seed=4).setups(ROOM)
    assert not config.team.name
    assert setup.world == ROOM
    _, configs = FlightRequest("room_100", seed=4, drones=2).setups(ROOM)
    assert [config.team.drone for config in configs] == [1, 2]
    assert {config.team.name for config in configs} == {"sitl"}


def test_a_team_has_the_sensors_that_the_page_selects() -> None:
    _, configs = FlightRequest("room_100", profile=OWN_PROFILE, range_m=4.0, drones=2).setups(ROOM)
    assert {range_models(config.sensors)[Beam.FRONT].max_m for config in configs} == {4.0}


def test_a_mission_that_a_team_does_not_fly_is_refused() -> None:
    with pytest.raises(ConfigError, match="is not flown by a team of 3"):
        FlightRequest("room_100", mission="room", drones=3).setups(ROOM)


def test_the_speed_says_why_it_is_lower_than_asked_for() -> None:
    _, [config] = FlightRequest("room_100").setups(ROOM)
    shown = Shown(config, [HERE], LiveScore(ROOM, 1.2, HERE, lambda score: None))
    shown.scoring.end()
    shown.asked, shown.asked_wall_s = 5.0, 100.0
    for wall_s, time_s in ((99.0, 0.0), (100.5, 10.0), (101.5, 13.1), (102.4, 15.89)):
        shown.seen.append((wall_s, moment(time_s)))
    assert shown.speed() == "3.1 of 5 × real time: the processor is busy"
    shown.asked = 3.0
    assert shown.speed() == "3.1 × real time"
    shown.asked = 0.0
    assert shown.speed() == "paused"
