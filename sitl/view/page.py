"""The simulator's page: the true building on one side, the drone's map on the other.

controls ───────────┐                ┌──► scene, numbers, plots
news of the flight ─┼─► in `ActQueue` ──┤
scores ─────────────┘                └──► orders to the flight's process
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from companion.config.settings import Config
from companion.core.errors import CompanionError
from companion.core.frames import Place, wrap_rad
from companion.core.messages import FloorPlan
from companion.view import downloads
from companion.view.access.act_queue import ActQueue, Event
from companion.view.access.server import PageServer
from companion.view.scene.camera import PANEL_PX, Framing
from companion.view.scene.instruments import PERIOD_S, Instruments
from companion.view.scene.mapped import MappedSide
from companion.view.snapshot import sketch_of
from sitl.core.errors import SitlError
from sitl.core.truth import TrueState
from sitl.scoring.score import MapScore
from sitl.simulation.simulation import start_state
from sitl.view.building import TrueSide
from sitl.view.controls import Controls
from sitl.view.flight_messages import (
    Begin,
    Ended,
    GiveUp,
    Land,
    News,
    Order,
    Pace,
    Refused,
    Seen,
    Step,
)
from sitl.view.flight_process import FlightProcess
from sitl.view.live_score import LiveScore
from sitl.view.outbox import later
from sitl.world.format import World
from sitl.world.loading import load_world

NUMBERS_PERIOD_S = 0.2
"""Period of the numbers, s."""
REMEMBERED = 1500
"""Moments kept: more than a minute at 20 Hz."""
BETWEEN_M = 2.5
"""Distance between the true building and the map, m."""
LABELS_M = 2.4
"""Distance of a side's label to the north of it, m."""
NAME_SCALE = 1.8
"""Size of a side's label relative to viser's default. Chosen."""
SPEED_OVER_S = 2.0
"""Time over which the speed is measured, s."""


@dataclass
class Shown:
    """The flight on the page."""

    config: Config
    take_off: TrueState
    scoring: LiveScore
    seen: deque[tuple[float, Seen]] = field(default_factory=lambda: deque(maxlen=REMEMBERED))
    """Moments with their wall time, s."""
    score: MapScore | None = None
    plan: FloorPlan | None = None


class Page:
    """One page, shared by all of its viewers.

    Raises:
        WorldError: the first world is invalid.
    """

    def __init__(self, server: PageServer, world: str) -> None:
        first = load_world(world)
        self._server = server
        self._turns = ActQueue(server, (SitlError, CompanionError))
        self._pending: Seen | None = None
        self._pending_lock = threading.Lock()
        self._shown_wall_s = self._plotted_wall_s = 0.0
        self._is_unshown = self._is_unplotted = False
        self._framing = Framing(server, *first.bounds)
        self._flights = 0
        self._shown: Shown | None = None
        self._true_side = TrueSide(server)
        self._mapped_side = MappedSide(server)
        server.gui.main_panel.dock_left()
        server.gui.main_panel.set_width(PANEL_PX)
        self._controls = Controls(server.gui)
        panel = server.gui.add_panel()
        with panel.add_tab("Flight"):
            self._instruments = Instruments(server.gui)
        panel.dock_right()
        panel.set_width(PANEL_PX)
        self._connect_controls()
        self._show_world(world, first)
        self._hangar = FlightProcess(self._receive)

    def run(self, is_over: Callable[[], bool]) -> None:
        """Serve until `is_over`."""
        self._turns.run(is_over, self._keep_up)

    def close(self) -> None:
        self._forget_flight()
        self._hangar.close()
        self._server.stop()

    # The controls

    def _connect_controls(self) -> None:
        controls, pressed = self._controls, self._turns.pressed
        controls.worlds.on_click(pressed(lambda: self._open_world(controls.worlds.value)))
        controls.open.on_click(pressed(lambda: self._open_world(controls.file.value.strip())))
        controls.start.on_click(pressed(self._start))
        controls.time.on_click(pressed(self._change_time))
        controls.speed.on_update(pressed(self._change_speed))
        controls.stop.on_click(pressed(self._stop))
        controls.take_over.on_click(pressed(lambda: self._order(controls.mode_to_take)))
        controls.inject.on_click(pressed(lambda: self._order(controls.fault_to_inject)))
        controls.hide_truth.on_update(pressed(self._hide_truth))
        controls.exaggeration.on_update(
            pressed(lambda: self._mapped_side.exaggerate(controls.exaggeration.value))
        )
        controls.fit.on_click(pressed(self._framing.all_in_view))
        controls.download.on_click(self._download)

    def _order(self, *orders: Order) -> None:
        if self._shown is None or self._shown.plan is not None:
            raise SitlError("no flight is under way; press Start")
        for order in orders:
            self._hangar.order(order)

    def _start(self) -> None:
        request = self._controls.request(self._world_name)
        config = request.config()
        setup = request.setup(config)
        self._forget_flight()
        self._flights += 1
        self._hangar.order(Begin(self._flights, request, self._controls.times_real_time))
        take_off = start_state(setup)
        height_m = config.mission.height_m
        scoring = LiveScore(setup.world, height_m, take_off, self._score_receiver(self._flights))
        self._shown = Shown(config, take_off, scoring)
        self._place_mapped_side(take_off)
        self._controls.download.disabled = True

    def _stop(self) -> None:
        """Land; time must pass for that."""
        self._order(Land(), Pace(self._controls.times_real_time))

    def _change_time(self) -> None:
        match self._controls.time.value:
            case "Pause":
                self._order(Pace(0.0))
            case "Resume":
                self._order(Pace(self._controls.times_real_time))
            case _:
                self._order(Step())

    def _change_speed(self) -> None:
        if self._shown is not None and self._shown.plan is None:
            self._order(Pace(self._controls.times_real_time))

    def _hide_truth(self) -> None:
        self._true_side.hide(hidden=self._controls.hide_truth.value)
        self._show_numbers()
        self._plot()

    def _download(self, event: Event) -> None:
        """Send the map, in viser's thread because drawing takes a second."""
        shown = self._shown
        if shown is None or shown.plan is None or event.client is None:
            return
        link = shown.config.link
        place = Place(link.origin_lat_deg, link.origin_lon_deg)
        try:
            title = self._world_name
            downloads.send(event.client, shown.plan, self._controls.format.value, title, place)
        except CompanionError as error:
            self._turns.complain(str(error), event.client)

    # The building

    def _open_world(self, name: str) -> None:
        world = load_world(name)
        self._forget_flight()
        self._show_world(name, world)

    def _show_world(self, name: str, world: World) -> None:
        self._world_name = name
        least, (north, east) = world.bounds
        _, west = least
        self._mapped_shift_m = east - west + BETWEEN_M
        self._true_side.build(world)
        self._mapped_side.clear()
        for side, title, shift_m in (
            ("true", f"the building: {world.name}", 0.0),
            ("mapped", "the drone's map", self._mapped_shift_m),
        ):
            self._server.scene.add_label(
                f"/name of {side} side",
                title,
                position=((west + east) / 2 + shift_m, north + LABELS_M, 0.0),
                anchor="bottom-center",
                font_screen_scale=NAME_SCALE,
            )
        self._framing.frame(least, (north + LABELS_M, east + self._mapped_shift_m))

    def _place_mapped_side(self, take_off: TrueState) -> None:
        """Place the map with the building's orientation, for comparison."""
        north, east, down = take_off.position_ned_m
        self._mapped_side.place((north, east + self._mapped_shift_m, down), take_off.yaw_rad)

    def _forget_flight(self) -> None:
        if self._shown is None:
            return
        if self._shown.plan is None:
            self._hangar.order(GiveUp())
        self._shown.scoring.end()
        self._shown = None
        self._true_side.restart()
        self._mapped_side.clear()

    # The flight

    def _receive(self, news: News) -> None:
        """Receive news in the hangar's thread."""
        if not isinstance(news, Seen):
            self._turns.put(lambda: self._take(news))
            return
        with self._pending_lock:
            is_first = self._pending is None
            self._pending = later(self._pending, news)
        if is_first:
            self._turns.put(self._see)

    def _score_receiver(self, flight: int) -> Callable[[MapScore], None]:
        def receive(score: MapScore) -> None:
            """Receive a score in the scorer's thread."""
            self._turns.put(lambda: self._take_score(flight, score))

        return receive

    def _take_score(self, flight: int, score: MapScore) -> None:
        if self._shown is not None and flight == self._flights:
            self._shown.score = score
            self._show_numbers()

    def _see(self) -> None:
        with self._pending_lock:
            seen, self._pending = self._pending, None
        shown = self._shown
        if seen is None or shown is None or seen.flight != self._flights:
            return
        shown.seen.append((time.monotonic(), seen))
        snapshot = seen.snapshot
        with self._server.atomic():
            self._true_side.show(seen.truth, snapshot.readings, snapshot.mount_offset_m)
            self._mapped_side.show(snapshot)
        if snapshot.sketch is not None:
            shown.scoring.update(snapshot.sketch.walls)
        self._is_unshown = self._is_unplotted = True

    def _keep_up(self) -> None:
        """Update numbers and plots at their periods, from the latest moment."""
        wall_s = time.monotonic()
        if self._is_unshown and wall_s - self._shown_wall_s > NUMBERS_PERIOD_S:
            self._shown_wall_s, self._is_unshown = wall_s, False
            self._show_numbers()
        if self._is_unplotted and wall_s - self._plotted_wall_s > PERIOD_S:
            self._plotted_wall_s, self._is_unplotted = wall_s, False
            self._plot()

    def _take(self, news: News) -> None:
        match news:
            case Ended(flight, _, plan, _) if self._shown is not None and flight == self._flights:
                self._shown.plan = plan
                self._shown.scoring.update(plan.walls)
                _, last = self._shown.seen[-1]
                self._mapped_side.show(replace(last.snapshot, sketch=sketch_of(plan)))
                self._controls.download.disabled = False
            case Ended():
                pass
            case Refused(reason):
                self._turns.complain(reason)

    def _show_numbers(self) -> None:
        shown = self._shown
        if shown is None or not shown.seen:
            return
        _, seen = shown.seen[-1]
        known = self._mapped_side.in_numbers
        known |= {"battery": f"{seen.battery:.0%}", "speed": self._speed(shown)}
        truth = {} if self._controls.hide_truth.value else _truth_rows(shown, seen)
        self._instruments.tell(seen.snapshot, known | truth)

    def _plot(self) -> None:
        shown = self._shown
        if shown is None:
            return
        moments = [seen for _, seen in shown.seen]
        heading_rad = shown.take_off.yaw_rad
        is_hidden = self._controls.hide_truth.value
        true_yaw_rad = [wrap_rad(seen.truth.yaw_rad - heading_rad) for seen in moments]
        snapshots = [seen.snapshot for seen in moments]
        self._instruments.plot(snapshots, None if is_hidden else true_yaw_rad)

    @staticmethod
    def _speed(shown: Shown) -> str:
        """Speed over the last seconds, in times real time."""
        last_wall_s, last = shown.seen[-1]
        first_wall_s, first = next(
            moment for moment in shown.seen if last_wall_s - moment[0] < SPEED_OVER_S
        )
        if last_wall_s <= first_wall_s:
            return "–"
        flown_s = last.snapshot.time_s - first.snapshot.time_s
        return f"{flown_s / (last_wall_s - first_wall_s):.1f} × real time"


def _truth_rows(shown: Shown, seen: Seen) -> dict[str, str]:
    score = shown.score
    rows = {"least clearance": f"{seen.clearance_m:.2f} m", "collisions": str(seen.collisions)}
    if score is not None:
        rows |= {
            "coverage": f"{score.coverage:.0%}",
            "wall error, aligned": f"{score.wall_error_aligned_cm:.1f} cm",
            "in take-off frame": f"{score.wall_error_cm:.1f} cm",
        }
    return rows
