"""Draws the map and its uncertainty, walls of earlier flights, the path and the drone."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from viser import PointCloudHandle, ViserServer

from companion.core.arrays import Array
from companion.core.frames import Vector2, Vector3, frd_to_ned, ned_to_enu
from companion.core.messages import Sketch, WallSegment
from companion.mapping.wall_lengths import TOLERANCE_SIGMAS, length_sigmas_m
from companion.view.scene.joined import joined
from companion.view.scene.labels import Label, Labels
from companion.view.scene.shapes import (
    MIN_THICKNESS_M,
    SHOWN_HEIGHT_M,
    Colour,
    Drone,
    Trail,
    Upright,
    about_up,
    position_ned_m,
    to_scene,
)
from companion.view.snapshot import Snapshot

UNSURE_M = 0.10
"""Standard deviation at which a wall gets the last colour, m. Chosen."""
SIGMA_COLOURS = ((0, 150, 136), (255, 193, 7), (211, 47, 47))
"""Colours from 0 to `UNSURE_M`, interpolated linearly."""
BAND_SIGMAS = 2
"""Half width of the uncertainty band, standard deviations. Chosen."""
BAND_HEIGHT_M = 0.02
"""Height of the uncertainty band above the floor, m. Chosen."""
LABELLED_FROM_M = 1.5
"""Shortest wall with a label, m. Chosen."""
MAX_LABELS = 60
"""Largest number of labels. Chosen."""
LABEL_SCALE = 1.2
"""Size of labels relative to viser's default. Chosen."""
LABEL_UP_M = 0.1
"""Height of a label above its wall, m. Chosen."""
LABEL_PERIOD_S = 2.0
"""Wall-clock time between updates of labels, s. Chosen: text loads a browser heavily."""
POINT_COLOUR = (84, 98, 111)
EARLIER_COLOUR = (139, 152, 159)
"""Colours of points and of walls of earlier flights, RGB, 0 to 255. Chosen."""
EARLIER_SHARE = 0.5
"""Height of walls of earlier flights relative to walls of this flight. Chosen."""


class MappedSide:
    """Walls, exaggerated 2σ bands, hits, path and drone."""

    def __init__(
        self, server: ViserServer, labels: Labels, colour: Colour, name: str = "/mapped"
    ) -> None:
        """`colour`: of path and drone."""
        scene = server.scene
        self._server = server
        self._name = name
        self._frame = scene.add_frame(name, show_axes=False)
        self._walls = Upright(scene, f"{name}/walls")
        self._earlier = Upright(scene, f"{name}/earlier", opacity=0.6)
        self._bands = Upright(scene, f"{name}/bands", opacity=0.3)
        self._points: PointCloudHandle = scene.add_point_cloud(
            f"{name}/points",
            np.zeros((1, 3)),
            POINT_COLOUR,
            point_size=0.025,
            point_shape="circle",
            precision="float32",
            visible=False,
        )
        self._path = Trail(scene, f"{name}/path", colour)
        self._drone = Drone(scene, f"{name}/drone", colour)
        self._labels = labels
        self._origin_ned_m, self._heading_rad = (0.0, 0.0, 0.0), 0.0
        self.wall_colour: Colour | None = None
        """Colour of walls and points, without labels; None: walls by standard deviation."""
        self._sketch = Sketch()
        self._walls_as_solved: tuple[WallSegment, ...] = ()
        self._exaggeration = 5.0
        self._labelled_wall_s = 0.0

    def place(self, origin_ned_m: Vector3, heading_rad: float) -> None:
        """Set the take-off position (NED, m) and heading (rad) of the map in the scene."""
        self._origin_ned_m, self._heading_rad = origin_ned_m, heading_rad
        self._frame.position = ned_to_enu(origin_ned_m)
        self._frame.wxyz = about_up(-heading_rad)

    def exaggerate(self, times: float) -> None:
        """Set the factor by which the uncertainty bands are wider than 2σ."""
        self._exaggeration = times
        self._draw(self._sketch)

    def show(self, snapshot: Snapshot) -> None:
        if snapshot.has_ended:
            self._labelled_wall_s = 0.0  # always label the final map
        if snapshot.sketch is not None:
            self._walls_as_solved = walls = snapshot.sketch.walls
            shown = walls if snapshot.has_ended else joined(walls)
            self._draw(replace(snapshot.sketch, walls=shown))
        if snapshot.pose is None:
            self._drone.hide()
            self._path.show([])
            return
        here = position_ned_m(snapshot.pose)
        self._drone.move(here, snapshot.pose.yaw_rad)
        self._drone.look(snapshot.readings, snapshot.mount_offset_m)
        if snapshot.sketch is not None:
            self._path.show(snapshot.sketch.path_ned_m)
        self._path.extend(here)

    @property
    def sketch(self) -> Sketch:
        """The map as it is drawn."""
        return self._sketch

    @property
    def walls(self) -> tuple[WallSegment, ...]:
        """The walls as the drone has solved them; in flight perhaps several pieces of one."""
        return self._walls_as_solved

    @property
    def in_numbers(self) -> dict[str, str]:
        """Rows for the table of numbers."""
        walls = self._sketch.walls
        length_m = sum(wall.length_m for wall in walls)
        return {"walls mapped": f"{len(walls)}, {length_m:.1f} m"}

    def clear(self) -> None:
        self._drone.hide()
        self._path.show([])
        self._walls_as_solved = ()
        self._draw(Sketch())

    def _draw(self, sketch: Sketch) -> None:
        self._sketch = sketch
        top_m = min(SHOWN_HEIGHT_M, sketch.ceiling_m or SHOWN_HEIGHT_M)
        ends = [(wall.start_ne_m, wall.end_ne_m) for wall in sketch.walls]
        sigmas_m = np.array([wall.sigma_m for wall in sketch.walls])
        colours = colours_of(sigmas_m)
        painted = colours if self.wall_colour is None else self.wall_colour
        earlier = [(wall.start_ne_m, wall.end_ne_m) for wall in sketch.earlier_walls]
        grey = np.tile(EARLIER_COLOUR, (len(earlier), 1))
        with self._server.atomic():
            thickness_m = MIN_THICKNESS_M
            self._earlier.show(earlier, 0.0, EARLIER_SHARE * top_m, thickness_m, grey)
            self._walls.show(ends, 0.0, top_m, thickness_m, painted, overlap_m=thickness_m)
            widths_m = 2 * BAND_SIGMAS * self._exaggeration * sigmas_m
            self._bands.show(ends, 0.0, BAND_HEIGHT_M, widths_m, colours)
            points = to_scene(sketch.points_ned_m)
            self._points.visible = len(points) > 0
            if len(points):
                self._points.points = points.astype(np.float32)
                self._points.colors = np.array(self.wall_colour or POINT_COLOUR, dtype=np.uint8)
            if time.monotonic() - self._labelled_wall_s > LABEL_PERIOD_S or not sketch.walls:
                self._labelled_wall_s = time.monotonic()
                self._label(sketch.walls if self.wall_colour is None else (), top_m)

    def _label(self, walls: tuple[WallSegment, ...], top_m: float) -> None:
        """Label long walls above their middle with length and tolerance; the longest come first."""
        both = sorted(
            zip(walls, length_sigmas_m(walls), strict=True), key=lambda it: -it[0].length_m
        )
        labels = [
            Label(
                f"{wall.length_m:.2f} ± {TOLERANCE_SIGMAS * sigma_m:.2f} m",
                self._in_scene((*_middle(wall), -top_m - LABEL_UP_M)),
                LABEL_SCALE,
            )
            for wall, sigma_m in both[:MAX_LABELS]
            if wall.length_m >= LABELLED_FROM_M
        ]
        self._labels.show(self._name.strip("/"), labels)

    def _in_scene(self, place_ned_m: Vector3) -> Vector3:
        """From the frame of the map, NED, to the scene, ENU."""
        north_m, east_m = frd_to_ned(*place_ned_m[:2], self._heading_rad)
        north_0_m, east_0_m, down_0_m = self._origin_ned_m
        return ned_to_enu((north_0_m + north_m, east_0_m + east_m, down_0_m + place_ned_m[2]))


def colours_of(sigmas_m: Array) -> Array:
    """Colours of standard deviations, (n,) m to (n, 3) RGB, 0 to 255."""
    steps_m = np.linspace(0, UNSURE_M, len(SIGMA_COLOURS))
    channels = np.array(SIGMA_COLOURS, dtype=float).T
    return np.column_stack([np.interp(sigmas_m, steps_m, channel) for channel in channels])


def _middle(wall: WallSegment) -> Vector2:
    (north_a, east_a), (north_b, east_b) = wall.start_ne_m, wall.end_ne_m
    return (north_a + north_b) / 2, (east_a + east_b) / 2


def extent_ne_m(sketch: Sketch, others: Sequence[Vector2] = ()) -> tuple[Vector2, Vector2]:
    """Smallest and largest (north, east) of the map and other places, with a margin, m."""
    walls = (*sketch.walls, *sketch.earlier_walls)
    places = [point for wall in walls for point in (wall.start_ne_m, wall.end_ne_m)]
    places += [*((north, east) for north, east, _ in sketch.path_ned_m), *others]
    norths, easts = zip(*places, strict=True) if places else ((0.0,), (0.0,))
    margin_m = 1.0 if places else 5.0
    return (
        (min(norths) - margin_m, min(easts) - margin_m),
        (max(norths) + margin_m, max(easts) + margin_m),
    )
