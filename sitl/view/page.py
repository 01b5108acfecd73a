"""The simulator's page: the true building on one side, the drone's map on the other.

controls ───────────┐                ┌──► scene, numbers, plots
news of the flight ─┼─► in `ActQueue` ──┤
scores ─────────────┘                └──► orders to the flight's process
"""

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from companion.core.errors import CompanionError
from companion.core.frames import wrap_rad
from companion.core.messages import FloorPlan
from companion.view import downloads
from companion.view.access.act_queue import ActQueue, Event
from companion.view.access.server import PageServer
from companion.view.playback import RECORDING_SUFFIX, playable
from companion.view.scene.camera import PANEL_PX
from companion.view.scene.card import Card, picture_of
from companion.view.scene.instruments import PERIOD_S, Instruments, Member
from companion.view.scene.plan import PlanView
from companion.view.uploads import Uploads
from sitl.core.errors import SitlError
from sitl.core.truth import TrueState
from sitl.scoring.score import MapScore
from sitl.simulation.simulation import start_state
from sitl.view.controls import ADD, Controls
from sitl.view.faults import action
from sitl.view.flight.messages import (
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
from sitl.view.flight.outbox import later
from sitl.view.flight.process import FlightProcess
from sitl.view.live_score import LiveScore
from sitl.view.shown import Shown
from sitl.view.sides import Sides
from sitl.world.format import World
from sitl.world.loading import load_world

NUMBERS_PERIOD_S = 0.2
"""Period of the numbers, s."""
FILES = "A world, a map (map.json), a plan or a mesh to fly in, or a recording to play"
SELECTED = "The instruments show it; faults and the pilot's switch are for it"


class Page:
    """One page, shared by all of its viewers.

    Raises:
        WorldError: the first world is invalid.
    """

    def __init__(self, server: PageServer, world: str, uploads: Path) -> None:
        """`uploads`: folder for files from the browser."""
        self.instead: Path | None = None
        """A recording from the browser, to be played instead."""
        first = load_world(world)
        self._server = server
        self._turns = ActQueue(server, (SitlError, CompanionError))
        self._pending: Seen | None = None
        self._pending_lock = threading.Lock()
        self._shown_wall_s = self._plotted_wall_s = 0.0
        self._is_unshown = self._is_unplotted = False
        self._flights = 0
        self._shown: Shown | None = None
        self._sides = Sides(server, first)
        server.gui.main_panel.dock_left()
        server.gui.main_panel.set_width(PANEL_PX)
        phone = server.gui.add_html("")
        self._controls = Controls(server.gui)
        with self._controls.world:
            Uploads(server.gui, self._turns, uploads, FILES, self._take_file)
        panel = server.gui.add_panel()
        with panel.add_tab("Flight"):
            self._selector = server.gui.add_dropdown("drone", ("1",), hint=SELECTED)
            self._instruments = Instruments(server.gui, phone)
        with panel.add_tab("Plan"):
            self._plan = PlanView(server.gui)
        panel.dock_right()
        panel.set_width(PANEL_PX)
        self._card = Card(server.gui, self._send_map)
        self._connect_controls()
        self._show_world(world, first)
        self._hangar = FlightProcess(self._receive)

    def run(self, is_over: Callable[[], bool]) -> None:
        """Serve until `is_over`, or a recording is to be played."""
        self._turns.run(lambda: is_over() or self.instead is not None, self._keep_up)

    def close(self) -> None:
        self._forget_flight()
        self._hangar.close()
        self._server.stop()

    # The controls

    def _connect_controls(self) -> None:
        controls, pressed = self._controls, self._turns.pressed
        controls.worlds.on_click(pressed(lambda: self._open_world(controls.worlds.value)))
        controls.open.on_click(pressed(lambda: self._open_world(controls.file.value.strip())))
        controls.uavs.on_click(pressed(self._add_or_remove))
        controls.mission.on_update(pressed(self._prepare_again))
        controls.seed.on_update(pressed(self._prepare_again))
        self._selector.on_update(pressed(self._select))
        controls.start.on_click(pressed(self._start))
        controls.time.on_click(pressed(self._change_time))
        controls.speed.on_update(pressed(self._change_speed))
        controls.stop.on_click(pressed(self._stop))
        controls.inject.on_click(pressed(self._inject))
        controls.hide_truth.on_update(pressed(self._hide_truth))
        controls.exaggeration.on_update(
            pressed(lambda: self._sides.exaggerate(controls.exaggeration.value))
        )
        controls.fit.on_click(pressed(self._sides.all_in_view))

    @property
    def _is_flying(self) -> bool:
        return self._shown is not None and self._shown.plan is None

    @property
    def _selected(self) -> int:
        """Number of the drone, from 0, that the instruments, faults and the pilot are of."""
        return int(self._selector.value) - 1

    def _select(self) -> None:
        self._score_map()
        self._show_numbers()
        self._plot()

    def _order(self, order: Order) -> None:
        if not self._is_flying:
            raise SitlError("no flight is under way; press Start")
        self._hangar.order(order)

    def _start(self) -> None:
        request = self._controls.request(self._world_name, self._drones)
        setups, configs = request.setups(self._world)
        self._forget_flight()
        self._flights += 1
        self._hangar.order(Begin(self._flights, request, self._controls.times_real_time))
        take_offs = [start_state(setup) for setup in setups]
        height_m = configs[0].mission.height_m
        receiver = self._score_receiver(self._flights)
        scoring = LiveScore(self._world, height_m, take_offs[0], receiver)
        self._shown = Shown(configs[0], take_offs, scoring)
        self._shown.ask(self._controls.times_real_time)
        self._put(take_offs)

    def _inject(self) -> None:
        order = self._controls.to_inject(self._selected)
        action(order.action, order.arguments)  # refused here rather than in flight
        self._order(order)

    def _stop(self) -> None:
        """Land; time must pass for that."""
        self._order(Land())
        self._pace(self._controls.times_real_time)

    def _change_time(self) -> None:
        match self._controls.time.value:
            case "Pause":
                self._pace(0.0)
            case "Resume":
                self._pace(self._controls.times_real_time)
            case _:
                self._pace(0.0)
                self._order(Step())

    def _pace(self, speed: float) -> None:
        self._order(Pace(speed))
        if self._shown is not None:
            self._shown.ask(speed)

    def _change_speed(self) -> None:
        if self._is_flying:
            self._pace(self._controls.times_real_time)

    def _hide_truth(self) -> None:
        self._sides.hide_truth(hidden=self._controls.hide_truth.value)
        self._show_numbers()
        self._plot()
        self._show_plan()
        self._card.tell(self._result())

    def _send_map(self, event: Event, name: str) -> None:
        """Send the map in a format, in viser's thread because drawing takes a second."""
        shown = self._shown
        if shown is None or shown.plan is None or event.client is None:
            return
        place = shown.config.link.place
        try:
            downloads.send(event.client, shown.plan, name, self._world.name, place)
        except CompanionError as error:
            self._turns.complain(str(error), event.client)

    # The building and the drones before take-off

    def _take_file(self, path: Path) -> None:
        """Open a file from the browser: a recording, a world, or a map to fly in."""
        if path.suffix == RECORDING_SUFFIX:
            playable(path)
            self.instead = path
        else:
            self._open_world(str(path))

    def _open_world(self, name: str) -> None:
        world = load_world(name)
        self._forget_flight()
        self._show_world(name, world)

    def _show_world(self, name: str, world: World) -> None:
        self._world_name, self._world = name, world
        self._sides.build(world)
        self._stand(1)

    def _add_or_remove(self) -> None:
        """Add or remove a drone, which flies from the next start on."""
        if self._is_flying:
            raise SitlError("UAVs are added and removed before take-off; stop this flight first")
        is_added = self._controls.uavs.value == ADD
        drones, most = self._drones + (1 if is_added else -1), self._controls.most_drones
        kind = self._controls.mission.value
        if drones > most:
            raise SitlError(f"a mission {kind!r} is for at most {most}")
        if drones < 1:
            raise SitlError("one UAV is left")
        self._stand(drones)
        self._forget_flight()

    def _prepare_again(self) -> None:
        """Take another mission or seed into account; a flight shown stays as it is."""
        if self._shown is None:
            self._stand(min(self._drones, self._controls.most_drones))

    def _stand(self, drones: int) -> None:
        """Show so many drones on their pads.

        Raises:
            SitlError: there is no place for a pad.
        """
        setups, _ = self._controls.request(self._world_name, drones).setups(self._world)
        self._drones = drones
        self._put([start_state(setup) for setup in setups])

    def _put(self, take_offs: Sequence[TrueState]) -> None:
        self._sides.stand(take_offs)
        numbers = [str(number + 1) for number in range(len(take_offs))]
        self._selector.options = numbers
        self._selector.visible = len(numbers) > 1
        on_pads = [Member(number + 1, "on its pad", None) for number in range(len(take_offs))]
        self._instruments.tell_team(on_pads)
        self._show_plan()

    def _forget_flight(self) -> None:
        if self._shown is None:
            return
        if self._shown.plan is None:
            self._hangar.order(GiveUp())
        self._shown.scoring.end()
        self._shown = None
        self._instruments.clear()
        self._card.hide()

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
            self._card.tell(self._result())

    def _see(self) -> None:
        with self._pending_lock:
            seen, self._pending = self._pending, None
        shown = self._shown
        if seen is None or shown is None or seen.flight != self._flights:
            return
        shown.seen.append((time.monotonic(), seen))
        self._sides.show(seen.drones)
        if seen.drones[self._selected].snapshot.sketch is not None:
            self._score_map()
        self._is_unshown = self._is_unplotted = True

    def _score_map(self) -> None:
        """Have the map of the selected drone scored; at the end, that of all."""
        shown, drone = self._shown, self._selected
        if shown is not None and shown.plan is None:
            shown.scoring.update(self._sides.map_of(drone).walls, shown.take_offs[drone])

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
            case Ended(flight, _, plan, drones) if flight == self._flights and self._shown:
                self._shown.plan = plan
                _, last = self._shown.seen[-1]
                if drones:
                    self._shown.scoring.update(plan.walls, self._shown.take_offs[drones[0]])
                self._sides.finish(plan, drones, last.drones)
                self._show_numbers()
                self._show_plan()
                self._deal(plan)
            case Ended():
                pass
            case Refused(reason):
                self._turns.complain(reason)

    def _deal(self, plan: FloorPlan) -> None:
        """Show the card once its picture is drawn, unless another flight has begun."""
        flight = self._flights

        def show(picture: bytes) -> None:
            if self._shown is not None and flight == self._flights:
                self._card.show(picture, self._result())

        def draw() -> None:
            picture = picture_of(plan)
            self._turns.put(lambda: show(picture))

        # no daemon: the end of the process would cut compiled code off, and abort
        threading.Thread(target=draw).start()

    def _result(self) -> dict[str, str]:
        """Rows of the card."""
        shown = self._shown
        if shown is None or not shown.seen:
            return {}
        _, seen = shown.seen[-1]
        drone = seen.drones[self._selected]
        rows = {"ended": drone.snapshot.activity, "flight time": f"{drone.snapshot.time_s:.0f} s"}
        rows |= self._sides.map_of(self._selected).in_numbers
        return rows | ({} if self._controls.hide_truth.value else shown.truth_rows(drone))

    def _show_numbers(self) -> None:
        shown = self._shown
        if shown is None or not shown.seen:
            return
        _, seen = shown.seen[-1]
        drone = seen.drones[self._selected]
        known = self._sides.map_of(self._selected).in_numbers | {"speed": shown.speed()}
        truth = {} if self._controls.hide_truth.value else shown.truth_rows(drone)
        self._instruments.tell(drone.snapshot, known | truth)
        snapshots = [each.snapshot for each in seen.drones]
        self._instruments.tell_team([Member.of(snapshot) for snapshot in snapshots])

    def _plot(self) -> None:
        shown = self._shown
        if shown is None:
            return
        moments = [seen.drones[self._selected] for _, seen in shown.seen]
        heading_rad = shown.take_offs[self._selected].yaw_rad
        is_hidden = self._controls.hide_truth.value
        true_yaw_rad = [wrap_rad(seen.truth.yaw_rad - heading_rad) for seen in moments]
        snapshots = [seen.snapshot for seen in moments]
        self._instruments.plot(snapshots, None if is_hidden else true_yaw_rad)
        self._show_plan()

    def _show_plan(self) -> None:
        seen = self._shown.seen[-1][1].drones if self._shown and self._shown.seen else ()
        pose = seen[self._selected].snapshot.pose if seen else None
        self._sides.draw_plan(self._plan, self._selected, pose)
