"""Shows labels in the scene so that none lies on another, whatever the camera.

A label has a constant size on the screen. Whenever a browser's camera or the labels change, the
boxes of all labels are projected. A label is shown if its box is in the window and free; the larger
ones come first.
"""

import threading
from collections.abc import Mapping, Sequence

import numpy as np
from viser import CameraHandle, ClientHandle, LabelHandle, ViserServer
from viser.transforms import SO3

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector3
from companion.core.values import value

EM_PX = 12.0
"""Size of the characters of viser's labels at scale 1, CSS pixels."""
WIDTH_EM, HEIGHT_EM = 0.6, 1.8
"""Width of a character, and height of a label with its margin. Measured for digits of DejaVu Sans,
which are wide: 0.56 em."""
MIN_DEPTH_M = 0.1
"""Least distance before the camera, m. Chosen."""
Key = tuple[str, int]


@value
class Label:
    """A text whose lower edge is centred at a place in the scene, ENU, m."""

    text: str
    at_enu_m: Vector3
    scale: float = 1.0
    """Size relative to viser's default."""


@value
class View:
    """What a camera sees."""

    eye_enu_m: Vector3
    axes: Array
    """(3, 3): its right, down and forward axes in ENU, as columns."""
    field_rad: float
    """Vertical field of view."""
    width_px: int
    height_px: int

    @classmethod
    def of(cls, camera: CameraHandle) -> "View":
        east_m, north_m, up_m = map(float, camera.position)
        axes = SO3(camera.wxyz).as_matrix().astype(float)
        size_px = camera.image_width, camera.image_height
        return cls((east_m, north_m, up_m), axes, float(camera.fov), *size_px)


class Labels:
    """All labels of the scene in groups by name."""

    def __init__(self, server: ViserServer) -> None:
        self._server = server
        self._lock = threading.Lock()
        self._labels: dict[str, Sequence[Label]] = {}
        self._handles: dict[int, dict[Key, LabelHandle]] = {}
        """Of each client, by group and number."""
        server.on_client_connect(self._welcome)
        server.on_client_disconnect(self._forget)

    def show(self, group: str, labels: Sequence[Label]) -> None:
        """Replace the labels of a group; of its labels of one size the first ones come first."""
        with self._lock:
            self._labels[group] = labels
        for client in self._server.get_clients().values():
            self._place(client)

    def _welcome(self, client: ClientHandle) -> None:
        client.camera.on_update(lambda _: self._place(client))
        self._place(client)

    def _forget(self, client: ClientHandle) -> None:
        with self._lock:
            self._handles.pop(client.client_id, None)

    def _place(self, client: ClientHandle) -> None:
        with self._lock:
            labels = {
                (group, number): label
                for group, members in self._labels.items()
                for number, label in enumerate(members)
            }
            labels = dict(sorted(labels.items(), key=lambda it: -it[1].scale))
            is_shown = free(list(labels.values()), View.of(client.camera))
            handles = self._handles.setdefault(client.client_id, {})
            with client.atomic():
                _draw(client, handles, labels, is_shown)


def free(labels: Sequence[Label], view: View) -> Mask:
    """(n,): True for each label that is in the window and lies on none of those before it."""
    boxes_px = boxes(labels, view)
    left, top, right, bottom = boxes_px.T
    fits = (left >= 0) & (top >= 0) & (right <= view.width_px) & (bottom <= view.height_px)
    is_free = np.zeros(len(labels), dtype=bool)
    is_free[fits] = unobstructed(boxes_px[fits])
    return is_free


def unobstructed(boxes_px: Array) -> Mask:
    """(n,): True for each box (n, 4) that lies on none of the True ones before it."""
    is_free = np.zeros(len(boxes_px), dtype=bool)
    for number, its in enumerate(boxes_px):
        others = boxes_px[is_free]
        overlaps = (its[:2] < others[:, 2:]) & (others[:, :2] < its[2:])
        is_free[number] = not overlaps.all(axis=1).any()
    return is_free


def boxes(labels: Sequence[Label], view: View) -> Array:
    """(n, 4): left, top, right and lower edge of each label, pixels; NaN behind the camera."""
    places = np.array([label.at_enu_m for label in labels], dtype=float).reshape(-1, 3)
    em_px = EM_PX * np.array([label.scale for label in labels])
    half_px = 0.5 * WIDTH_EM * em_px * np.array([len(label.text) + 1 for label in labels])
    right_m, down_m, depth_m = ((places - view.eye_enu_m) @ view.axes).T
    depth_m = np.where(depth_m > MIN_DEPTH_M, depth_m, np.nan)
    focal_px = view.height_px / 2 / np.tan(view.field_rad / 2)
    x_px = view.width_px / 2 + focal_px * right_m / depth_m
    y_px = view.height_px / 2 + focal_px * down_m / depth_m
    return np.column_stack([x_px - half_px, y_px - HEIGHT_EM * em_px, x_px + half_px, y_px])


def _draw(
    client: ClientHandle,
    handles: dict[Key, LabelHandle],
    labels: Mapping[Key, Label],
    is_shown: Mask,
) -> None:
    """Change what differs: each change is a message to the browser."""
    for key in handles.keys() - labels.keys():
        handles[key].visible = False
    for (key, label), visible in zip(labels.items(), is_shown.tolist(), strict=True):
        handle = handles.get(key)
        if handle is None:
            if visible:
                handles[key] = _added(client, key, label)
            continue
        if handle.text != label.text:
            handle.text = label.text
        if not np.allclose(handle.position, label.at_enu_m):
            handle.position = label.at_enu_m
        if handle.visible != visible:
            handle.visible = visible


def _added(client: ClientHandle, key: Key, label: Label) -> LabelHandle:
    group, number = key
    return client.scene.add_label(
        f"/labels/{group}/{number}",
        label.text,
        position=label.at_enu_m,
        anchor="bottom-center",
        font_screen_scale=label.scale,
    )
