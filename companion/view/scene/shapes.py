"""Draws upright boxes, paths and the drone in a viser scene, which is ENU, m."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import trimesh
from viser import BatchedMeshHandle, SceneApi

from companion.core.arrays import Array
from companion.core.frames import Vector2, Vector3, ned_to_enu, yaw_ned_to_enu
from companion.core.messages import Beam, Pose, RangeReading, RangeState
from companion.export.colours import flight_colour

Colour = tuple[int, int, int]
Quaternion = tuple[float, float, float, float]

SHOWN_HEIGHT_M = 1.2
"""Height at which walls are cut off, m. Chosen: the view from above stays open."""
MIN_THICKNESS_M = 0.06
"""Thickness of a drawn wall, m. Chosen."""
SEEN_COLOUR: Colour = (231, 111, 81)
NOTHING_COLOUR: Colour = (170, 178, 184)
TOO_NEAR_COLOUR: Colour = (214, 40, 40)
NOSE_COLOUR: Colour = (244, 162, 97)
TRAIL_STEP_M = 0.05
"""Smallest distance between points of a drawn path, m. Chosen."""
MAX_END = 50
"""Largest number of points in the updated end of a path. Chosen."""
NOTHING_TO_M = 3.0
"""Drawn length of a beam without a return, m. Chosen."""
BEAM_FLU: Mapping[Beam, Vector3] = {
    Beam.FRONT: (1.0, 0.0, 0.0),
    Beam.BACK: (-1.0, 0.0, 0.0),
    Beam.LEFT: (0.0, 1.0, 0.0),
    Beam.RIGHT: (0.0, -1.0, 0.0),
    Beam.UP: (0.0, 0.0, 1.0),
    Beam.DOWN: (0.0, 0.0, -1.0),
}
"""Unit vector of each beam, body frame forward-left-up."""


def drone_colour(number: int) -> Colour:
    """Colour of a drone of a team by its number, from 0; that of its path on a joint map."""
    red, green, blue = bytes.fromhex(flight_colour(number)[1:])
    return red, green, blue


def to_scene(points_ned: Sequence[Vector3] | Array) -> Array:
    """Convert points (n, 3) from NED to the scene's ENU."""
    points = np.asarray(points_ned, dtype=float).reshape(-1, 3)
    return points[:, [1, 0, 2]] * [1, 1, -1]


def about_up(angle_rad: float) -> Quaternion:
    """Quaternion (w, x, y, z) of a rotation about the up axis, anticlockwise from above."""
    return math.cos(angle_rad / 2), 0.0, 0.0, math.sin(angle_rad / 2)


class Upright:
    """Many upright boxes as one scene node, each with its own colour."""

    def __init__(self, scene: SceneApi, name: str, *, opacity: float | None = None) -> None:
        self._scene = scene
        self._name = name
        self._opacity = opacity
        self._box = trimesh.creation.box()
        self._handle: BatchedMeshHandle | None = None

    def show(
        self,
        ends_ne_m: Sequence[tuple[Vector2, Vector2]],
        bottoms_m: Sequence[float] | Array | float,
        tops_m: Sequence[float] | Array | float,
        thickness_m: Sequence[float] | Array | float,
        colours: Array | Colour,
        *,
        overlap_m: float = 0.0,
    ) -> None:
        """Replace the boxes: along segments (north, east) between two heights, m.

        `overlap_m` lengthens each box, so that corners have no gap.
        """
        count = len(ends_ne_m)
        if not count:
            self.clear()
            return
        ends = np.array(ends_ne_m, dtype=float).reshape(count, 2, 2)[..., ::-1]  # east, north
        along = ends[:, 1] - ends[:, 0]
        half_rad = np.arctan2(along[:, 1], along[:, 0]) / 2
        bottom_m, top_m = np.broadcast_to(bottoms_m, count), np.broadcast_to(tops_m, count)
        thick_m = np.broadcast_to(thickness_m, count)
        zero = np.zeros(count)
        self._handle = self._scene.add_batched_meshes_simple(
            self._name,
            self._box.vertices,
            self._box.faces,
            batched_wxyzs=np.column_stack([np.cos(half_rad), zero, zero, np.sin(half_rad)]),
            batched_positions=np.column_stack([ends.mean(axis=1), (bottom_m + top_m) / 2]),
            batched_scales=np.column_stack(
                [np.linalg.norm(along, axis=1) + overlap_m, thick_m, top_m - bottom_m]
            ),
            batched_colors=np.broadcast_to(np.asarray(colours, dtype=np.uint8), (count, 3)),
            opacity=self._opacity,
            lod="off",
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
        )

    def clear(self) -> None:
        if self._handle is not None:
            self._handle.remove()
            self._handle = None


class Trail:
    """A growing path; an extension sends only the last `MAX_END` points."""

    def __init__(self, scene: SceneApi, name: str, colour: Colour) -> None:
        self._flown: list[Vector3] = []
        self._end: list[Vector3] = []
        self._lines = [
            scene.add_line_segments(
                f"{name}/{part}", np.zeros((1, 2, 3)), colour, thickness=0.04, visible=False
            )
            for part in ("flown", "end")
        ]

    def show(self, points_ned: Sequence[Vector3]) -> None:
        """Replace the path."""
        self._flown, self._end = list(points_ned), list(points_ned[-1:])
        self._draw(0, self._flown)
        self._draw(1, self._end)

    def extend(self, point_ned: Vector3) -> None:
        if self._end and math.dist(self._end[-1], point_ned) < TRAIL_STEP_M:
            return
        self._end.append(point_ned)
        if len(self._end) > MAX_END:
            self.show([*self._flown, *self._end[1:]])
        else:
            self._draw(1, self._end)

    def _draw(self, line: int, points_ned: Sequence[Vector3]) -> None:
        handle = self._lines[line]
        points = to_scene(points_ned)
        handle.visible = len(points) > 1
        if len(points) > 1:
            handle.points = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)


class Drone:
    """The drone with four rotors, a nose, and beams as long as their readings."""

    def __init__(self, scene: SceneApi, name: str, colour: Colour) -> None:
        self._frame = scene.add_frame(name, show_axes=False, visible=False)
        body, nose = _body()
        red, green, blue = (channel // 2 for channel in colour)  # light brightens a body
        scene.add_mesh_simple(
            f"{name}/body", body.vertices, body.faces, color=(red, green, blue), cast_shadow=False
        )
        scene.add_mesh_simple(
            f"{name}/nose", nose.vertices, nose.faces, color=NOSE_COLOUR, cast_shadow=False
        )
        self._beams = scene.add_line_segments(
            f"{name}/beams", np.zeros((1, 2, 3)), SEEN_COLOUR, thickness=0.03, visible=False
        )

    def move(self, position_ned_m: Vector3, yaw_rad: float) -> None:
        self._frame.visible = True
        self._frame.position = ned_to_enu(position_ned_m)
        self._frame.wxyz = about_up(yaw_ned_to_enu(yaw_rad))

    def look(self, readings: Mapping[Beam, RangeReading], mount_offset_m: float) -> None:
        """Draw the beams to the length of their readings."""
        seen = [
            (np.array(BEAM_FLU[beam]), *drawn)
            for beam, reading in readings.items()
            if (drawn := _drawn(reading)) is not None
        ]
        self._beams.visible = bool(seen)
        if seen:
            self._beams.points = np.array(
                [
                    (axis * mount_offset_m, axis * (mount_offset_m + length_m))
                    for axis, length_m, _ in seen
                ],
                dtype=np.float32,
            )
            self._beams.colors = np.array(
                [(colour, colour) for _, _, colour in seen], dtype=np.uint8
            )

    def hide(self) -> None:
        self._frame.visible = False


def position_ned_m(pose: Pose) -> Vector3:
    """Position of a pose, local NED, m."""
    return pose.north_m, pose.east_m, pose.down_m


def _drawn(reading: RangeReading) -> tuple[float, Colour] | None:
    """Drawn length (m) and colour of a beam; None if the reading is not valid."""
    match reading.state:
        case RangeState.DISTANCE:
            return reading.distance_m, SEEN_COLOUR
        case RangeState.NOTHING:
            return NOTHING_TO_M, NOTHING_COLOUR
        case RangeState.TOO_NEAR:
            guess_m = reading.distance_m
            return guess_m if math.isfinite(guess_m) else 0.3, TOO_NEAR_COLOUR
        case _:
            return None


def _body() -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """Meshes of the body (radius 0.2 m, nose along x) and of the nose."""
    parts = [trimesh.creation.box((0.16, 0.10, 0.06))]
    for turn in range(4):
        angle_rad = math.pi / 4 + turn * math.pi / 2
        arm = trimesh.creation.box((0.14, 0.02, 0.02))
        arm.apply_translation((0.07, 0, 0))
        rotor = trimesh.creation.cylinder(radius=0.07, height=0.015, sections=16)
        rotor.apply_translation((0.14, 0, 0.03))
        for part in (arm, rotor):
            part.apply_transform(trimesh.transformations.rotation_matrix(angle_rad, (0, 0, 1)))
            parts.append(part)
    nose = trimesh.creation.cone(radius=0.05, height=0.14, sections=16)
    nose.apply_transform(trimesh.transformations.rotation_matrix(math.pi / 2, (0, 1, 0)))
    nose.apply_translation((0.08, 0, 0))
    body = trimesh.util.concatenate(parts)
    assert isinstance(body, trimesh.Trimesh)
    return body, nose
