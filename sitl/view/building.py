"""Draws the true side of the scene: the building, and the drones' true poses."""

from collections.abc import Mapping, Sequence

import numpy as np
import trimesh
from viser import MeshHandle, SceneApi, ViserServer

from companion.core.frames import Vector2
from companion.core.messages import Beam, RangeReading
from companion.view.scene.shapes import (
    MIN_THICKNESS_M,
    SHOWN_HEIGHT_M,
    Drone,
    Trail,
    Upright,
    drone_colour,
    to_scene,
)
from sitl.core.truth import TrueState
from sitl.view.flight.messages import SeenDrone
from sitl.world.format import Segment, World

WALL_COLOUR = (108, 117, 125)
BORDER_COLOUR = (200, 85, 61)
BORDER_OPACITY = 0.3
"""Opacity of a wall at the border to the unknown."""
BOX_COLOUR = (176, 164, 148)
"""Colours, also those above, RGB, 0 to 255. Chosen."""


class TrueSide:
    """The building of the world file, in the world frame."""

    def __init__(self, server: ViserServer, name: str = "/true") -> None:
        scene = server.scene
        self._scene = scene
        self._name = name
        self._frame = scene.add_frame(name, show_axes=False)
        self._walls = Upright(scene, f"{name}/walls")
        self._border = Upright(scene, f"{name}/border", opacity=BORDER_OPACITY)
        self._boxes = Upright(scene, f"{name}/boxes")
        self._mesh: MeshHandle | None = None
        self._drones: list[_TrueDrone] = []

    def hide(self, *, hidden: bool) -> None:
        self._frame.visible = not hidden

    def build(self, world: World) -> None:
        """Show another building, without drones."""
        panels = [panel for panel in world.panels if panel.bottom_m < SHOWN_HEIGHT_M]
        self._walls.show(
            [(panel.start, panel.end) for panel in panels],
            [panel.bottom_m for panel in panels],
            [min(panel.top_m, SHOWN_HEIGHT_M) for panel in panels],
            [max(panel.thickness_m, MIN_THICKNESS_M) for panel in panels],
            WALL_COLOUR,
            overlap_m=MIN_THICKNESS_M,
        )
        top_m = min(world.height_m, SHOWN_HEIGHT_M)
        self._border.show(world.closed_border, 0.0, top_m, MIN_THICKNESS_M, BORDER_COLOUR)
        boxes = [box for box in world.boxes if box.bottom_m < SHOWN_HEIGHT_M]
        self._boxes.show(
            [_middle_line(box.corner, box.size) for box in boxes],
            [box.bottom_m for box in boxes],
            [min(box.top_m, SHOWN_HEIGHT_M) for box in boxes],
            [box.size[1] for box in boxes],
            BOX_COLOUR,
        )
        self._build_mesh(world)
        self.stand(())

    def _build_mesh(self, world: World) -> None:
        """Show an imported mesh without its part above the cut."""
        if self._mesh is not None:
            self._mesh.remove()
            self._mesh = None
        if world.mesh is None:
            return
        whole = trimesh.Trimesh(to_scene(world.mesh.vertices), world.mesh.faces, process=False)
        cut = whole.slice_plane((0, 0, SHOWN_HEIGHT_M), (0, 0, -1))
        if cut is not None and len(cut.faces):
            self._mesh = self._scene.add_mesh_simple(
                f"{self._name}/mesh",
                np.asarray(cut.vertices),
                np.asarray(cut.faces),
                color=WALL_COLOUR,
                side="double",
                flat_shading=True,
                cast_shadow=False,
            )

    def stand(self, take_offs: Sequence[TrueState]) -> None:
        """Show these drones where they take off, and no others."""
        for number in range(len(self._drones), len(take_offs)):
            self._drones.append(_TrueDrone(self._scene, self._name, number))
        for drone in self._drones:
            drone.hide()
        for drone, take_off in zip(self._drones, take_offs, strict=False):
            drone.show(take_off, {}, 0.0)

    def show(self, seen: Sequence[SeenDrone]) -> None:
        """Show the drones at their true poses, with their range readings."""
        for drone, each in zip(self._drones, seen, strict=False):
            snapshot = each.snapshot
            drone.show(each.truth, snapshot.readings, snapshot.mount_offset_m)


class _TrueDrone:
    """One drone and its true path."""

    def __init__(self, scene: SceneApi, name: str, number: int) -> None:
        """`name`: of the side; `number`: of the drone, from 0."""
        colour = drone_colour(number)
        self._path = Trail(scene, f"{name}/path {number + 1}", colour)
        self._drone = Drone(scene, f"{name}/drone {number + 1}", colour)

    def hide(self) -> None:
        self._path.show([])
        self._drone.hide()

    def show(
        self, truth: TrueState, readings: Mapping[Beam, RangeReading], mount_offset_m: float
    ) -> None:
        here = truth.position_ned_m
        self._drone.move(here, truth.yaw_rad)
        self._drone.look(readings, mount_offset_m)
        self._path.extend(here)


def _middle_line(corner: Vector2, size: Vector2) -> Segment:
    """Middle line of a box along north."""
    (north, east), (depth_m, width_m) = corner, size
    return (north, east + width_m / 2), (north + depth_m, east + width_m / 2)
