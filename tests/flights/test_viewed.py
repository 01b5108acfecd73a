"""Tests of flights requested by the page, and of their process, without a browser."""

from multiprocessing import Pipe
from queue import Queue
from threading import Thread
from typing import TypeVar

import pytest

from companion.core.errors import ConfigError
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.view.flight.flying import serve
from sitl.view.flight.messages import (
    Begin,
    Ended,
    GiveUp,
    Inject,
    Land,
    News,
    Pace,
    Refused,
    Seen,
    Step,
)
from sitl.view.flight.process import FlightProcess
from sitl.view.request import OWN_PROFILE, FlightRequest
from sitl.world.loading import load_world
from tests.waiting import DEADLINE_S

FAST = 1000.0
N = TypeVar("N", Seen, Refused, Ended)


def test_a_flight_with_custom_sensor_values_completes() -> None:
    request = FlightRequest("room_100", profile=OWN_PROFILE, range_m=4.0, range_sigma_m=0.03)
    (setup,), (config,) = request.setups(load_world("room_100"))
    app, simulation = fly_in_lockstep(setup, config, lambda progress: None)
    assert app.flight.completed, app.flight.ending
    assert simulation.record.collisions == 0


def test_an_invalid_setting_is_refused_by_its_key() -> None:
    with pytest.raises(ConfigError, match=r"this page: mission\.standoff = 9"):
        FlightRequest("room_100", standoff=9.0).config()


class Page:
    """The page's end of the connection to the flight's process, which is a thread here."""

    def __init__(self) -> None:
        self.orders, theirs = Pipe()
        self._thread = Thread(target=serve, args=(theirs,), daemon=True)
        self._thread.start()
        self.news: Queue[News] = Queue()
        Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        try:
            while True:
                self.news.put(self.orders.recv())
        except (EOFError, OSError):
            return

    def until(self, kind: type[N]) -> N:
        while True:
            news = self.news.get(timeout=DEADLINE_S)
            if isinstance(news, kind):
                return news


def test_the_page_shows_pauses_steps_and_takes_over_a_flight() -> None:
    page = Page()
    page.orders.send(Begin(7, FlightRequest("room_100"), FAST))
    seen = page.until(Seen)
    assert seen.flight == 7
    page.orders.send(Pace(0.0))
    page.orders.send(Step())
    page.orders.send(Step())
    page.orders.send(Inject(0, "somebody_near", {"forward_m": 1.8, "for_s": 1.0}))
    page.orders.send(Pace(FAST))
    while seen.drones[0].truth.position_ned_m[2] > -1.0:
        seen = page.until(Seen)
    page.orders.send(Inject(0, "pilot_mode", {"name": "LOITER"}))
    ended = page.until(Ended)
    assert ended.endings == ("handed over: mode changed to LOITER",)


def test_orders_reach_the_selected_drone_of_a_team() -> None:
    page = Page()
    page.orders.send(Begin(1, FlightRequest("room_100", drones=2), FAST))
    seen = page.until(Seen)
    while max(drone.truth.position_ned_m[2] for drone in seen.drones) > -1.0:
        seen = page.until(Seen)
    assert [drone.snapshot.drone for drone in seen.drones] == [1, 2]
    page.orders.send(Inject(1, "pilot_mode", {"name": "LOITER"}))
    while not seen.drones[1].snapshot.has_ended:
        seen = page.until(Seen)
    assert not seen.drones[0].snapshot.has_ended
    page.orders.send(Land())
    ended = page.until(Ended)
    first, second = ended.endings
    assert first == "landed: landing was requested"
    assert second == "handed over: mode changed to LOITER"
    assert len(ended.plan.paths) == len(ended.drones)


def test_an_abandoned_flight_does_not_delay_the_next_request() -> None:
    page = Page()
    page.orders.send(Begin(1, FlightRequest("room_100"), FAST))
    page.until(Seen)
    page.orders.send(GiveUp())
    page.orders.send(Begin(2, FlightRequest("nowhere"), FAST))
    refused = page.until(Refused)
    assert "no world 'nowhere'" in refused.reason


def test_a_flight_process_that_died_is_restarted() -> None:
    news: Queue[News] = Queue()
    hangar = FlightProcess(news.put)
    hangar.order(Begin(1, FlightRequest("room_100"), 1.0))
    assert isinstance(news.get(timeout=DEADLINE_S), Seen)
    hangar._process.kill()
    while not isinstance(news.get(timeout=DEADLINE_S), Refused):
        continue
    hangar._process.join(DEADLINE_S)
    hangar.order(Begin(2, FlightRequest("room_100"), 1.0))
    seen = news.get(timeout=DEADLINE_S)
    assert isinstance(seen, Seen)
    assert seen.flight == 2
    hangar.close()
