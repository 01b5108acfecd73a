"""Arranges a page without ground truth: map, teammates, numbers and plots."""

from collections.abc import Sequence

from companion.core.frames import Vector2
from companion.core.messages import Sketch
from companion.export.colours import flight_colour
from companion.team.teammate import Heard
from companion.view.access.server import PageServer
from companion.view.scene.camera import PANEL_PX, Framing
from companion.view.scene.instruments import Instruments, Member
from companion.view.scene.labels import Labels
from companion.view.scene.mapped import MappedSide, extent_ne_m
from companion.view.scene.plan import PlanView
from companion.view.scene.shapes import Drone, drone_colour
from companion.view.snapshot import Snapshot


class Screen:
    """A page whose camera moves back when the map exceeds the view."""

    def __init__(self, server: PageServer) -> None:
        self._server = server
        self._mapped: MappedSide | None = None
        """None before the drone's number, which determines its colour, is known."""
        self._labels = Labels(server)
        self._exaggeration = 5.0
        self._mates: dict[int, Drone] = {}
        """Teammates by number."""
        phone = server.gui.add_html("")
        server.gui.main_panel.dock_left()
        server.gui.main_panel.set_width(PANEL_PX)
        panel = server.gui.add_panel()
        with panel.add_tab("Flight"):
            self._instruments = Instruments(server.gui, phone)
        with panel.add_tab("Plan"):
            self._plan = PlanView(server.gui)
        panel.dock_right()
        panel.set_width(PANEL_PX)
        self._extent = extent_ne_m(Sketch())
        self._framing = Framing(server, *self._extent)

    def show(self, snapshot: Snapshot) -> None:
        if self._mapped is None:
            colour = drone_colour(snapshot.drone - 1)
            self._mapped = MappedSide(self._server, self._labels, colour)
            self._mapped.exaggerate(self._exaggeration)
        with self._server.atomic():
            self._mapped.show(snapshot)
            self._show_mates(snapshot.mates)
        members = [Member.of(snapshot), *map(Member.of_mate, snapshot.mates)]
        self._instruments.tell_team(sorted(members, key=lambda member: member.drone))
        self._instruments.tell(snapshot, self._mapped.in_numbers)
        if snapshot.sketch is not None:
            extent = extent_ne_m(snapshot.sketch, [mate.ne_m for mate in snapshot.mates])
            if _reaches_beyond(extent, self._extent):
                self._extent = extent
                self._framing.frame(*extent)

    def _show_mates(self, mates: Sequence[Heard]) -> None:
        for drone in self._mates.values():
            drone.hide()
        for mate in mates:
            name = f"/mate {mate.drone}"
            if mate.drone not in self._mates:
                colour = drone_colour(mate.drone - 1)
                self._mates[mate.drone] = Drone(self._server.scene, name, colour)
            self._mates[mate.drone].move((*mate.ne_m, -mate.height_m), mate.yaw_rad)

    def plot(self, window: Sequence[Snapshot]) -> None:
        self._instruments.plot(window)
        if self._mapped is not None and window:
            last = window[-1]
            self._plan.show(self._mapped.sketch, last.pose, flight_colour(last.drone - 1))

    def exaggerate(self, times: float) -> None:
        self._exaggeration = times
        if self._mapped is not None:
            self._mapped.exaggerate(times)

    def fit(self) -> None:
        self._framing.all_in_view()


def _reaches_beyond(extent: tuple[Vector2, Vector2], shown: tuple[Vector2, Vector2]) -> bool:
    (south, west), (north, east) = extent
    (least_north, least_east), (most_north, most_east) = shown
    return south < least_north or west < least_east or north > most_north or east > most_east
