"""Both sides of the page's scene: the building with the drones, and beside it their maps."""

from collections.abc import Sequence
from dataclasses import replace

from viser import ViserServer

from companion.core.frames import ned_to_enu
from companion.core.messages import FloorPlan, Pose
from companion.export.colours import flight_colour
from companion.view.scene.camera import Framing
from companion.view.scene.labels import Label, Labels
from companion.view.scene.mapped import MappedSide
from companion.view.scene.plan import Line, Placed, PlanView
from companion.view.scene.shapes import SHOWN_HEIGHT_M, drone_colour
from companion.view.snapshot import sketch_of
from sitl.core.truth import TrueState
from sitl.view.building import TrueSide
from sitl.view.flight.messages import SeenDrone
from sitl.world.format import World

BETWEEN_M = 2.5
"""Distance between the true building and the map, m."""
LABELS_M = 2.4
"""Distance of a side's label to the north of it, m."""
NAME_SCALE = 1.4
"""Size of a side's label relative to viser's default. Chosen."""


class Sides:
    """The scene; the maps of all drones lie over each other, in the building's orientation."""

    def __init__(self, server: ViserServer, world: World) -> None:
        self._server = server
        self._framing = Framing(server, *world.bounds)
        self._labels = Labels(server)
        self._true_side = TrueSide(server)
        self._maps: list[MappedSide] = []
        """The map of each drone."""
        self._joint: int | None = None
        """The drone whose map is that of all; None before the end of the flight."""
        self._take_offs: Sequence[TrueState] = ()
        self._exaggeration = 5.0
        self._true_walls: Sequence[Line] = ()
        self._is_truth_hidden = False

    def build(self, world: World) -> None:
        """Show another building, without drones."""
        least, (north, east) = world.bounds
        _, west = least
        self._mapped_shift_m = east - west + BETWEEN_M
        self._true_side.build(world)
        panels = [panel for panel in world.panels if panel.bottom_m < SHOWN_HEIGHT_M]
        boxes = [box for box in world.boxes if box.bottom_m < SHOWN_HEIGHT_M]
        self._true_walls = [(panel.start, panel.end) for panel in panels]
        self._true_walls += [segment for box in boxes for segment in box.segments]
        self._label_ned_m = north + LABELS_M, (west + east) / 2, 0.0
        self._true_name = f"building: {world.name}"
        self._framing.frame(least, (north + LABELS_M, east + self._mapped_shift_m))

    def _name(self, map_name: str) -> None:
        """Name both sides."""
        east_m, north_m, up_m = ned_to_enu(self._label_ned_m)
        self._labels.show(
            "names",
            [
                Label(self._true_name, (east_m, north_m, up_m), NAME_SCALE),
                Label(map_name, (east_m + self._mapped_shift_m, north_m, up_m), NAME_SCALE),
            ],
        )

    def stand(self, take_offs: Sequence[TrueState]) -> None:
        """Show the drones where they take off, with empty maps."""
        self._take_offs = take_offs
        self._joint = None
        self._true_side.stand(take_offs)
        for number in range(len(self._maps), len(take_offs)):
            name = f"/mapped {number + 1}"
            self._maps.append(MappedSide(self._server, self._labels, drone_colour(number), name))
            self._maps[number].exaggerate(self._exaggeration)
        for side in self._maps:
            side.clear()
        is_team = len(take_offs) > 1
        self._name("maps" if is_team else "map")
        for number, take_off in enumerate(take_offs):
            self._place(number, take_off)
            self._maps[number].wall_colour = drone_colour(number) if is_team else None

    def _place(self, number: int, origin: TrueState) -> None:
        """Place the map of a drone with its origin at a pose in the building."""
        north, east, down = origin.position_ned_m
        self._maps[number].place((north, east + self._mapped_shift_m, down), origin.yaw_rad)

    def show(self, drones: Sequence[SeenDrone]) -> None:
        with self._server.atomic():
            self._true_side.show(drones)
            for side, drone in zip(self._maps, drones, strict=False):
                side.show(drone.snapshot)

    def finish(self, plan: FloorPlan, drones: Sequence[int], last: Sequence[SeenDrone]) -> None:
        """Show the final map, which is in the frame of the first of `drones`.

        `drones`: of each path in the map; `last`: the last moment of the flight.
        """
        self._joint = drones[0] if drones else None
        for number, path in zip(drones, plan.paths, strict=False):
            side, is_first = self._maps[number], number == drones[0]
            self._place(number, self._take_offs[drones[0]])
            side.wall_colour = None
            own = replace(plan if is_first else FloorPlan(), path=path, begins=(0,))
            pose = path[-1] if path else None
            side.show(replace(last[number].snapshot, pose=pose, sketch=sketch_of(own)))

    def map_of(self, drone: int) -> MappedSide:
        """The map of a drone, from 0; after the flight, that of all."""
        return self._maps[drone if self._joint is None else self._joint]

    def exaggerate(self, times: float) -> None:
        self._exaggeration = times
        for side in self._maps:
            side.exaggerate(times)

    def draw_plan(self, plan: PlanView, drone: int, pose: Pose | None) -> None:
        """Draw the map of a drone, from 0, over the building; `pose`: of the drone in its map."""
        number = drone if self._joint is None else self._joint
        origin = self._take_offs[number]
        north_m, east_m, _ = origin.position_ned_m
        plan.show(
            self._maps[number].sketch,
            pose if number == drone else None,
            flight_colour(drone),
            Placed((north_m, east_m), origin.yaw_rad),
            () if self._is_truth_hidden else self._true_walls,
        )

    def hide_truth(self, *, hidden: bool) -> None:
        self._is_truth_hidden = hidden
        self._true_side.hide(hidden=hidden)

    def all_in_view(self) -> None:
        self._framing.all_in_view()
