"""Places the camera south of and above the map, so that the whole map is in view."""

import math

import numpy as np
from viser import CameraHandle, ClientHandle, ViserServer

from companion.core.frames import Vector2, Vector3

ELEVATION_RAD = math.radians(58)
"""Elevation of the camera above the floor, seen from the centre, rad. Chosen."""
FIELD_RAD = math.radians(40)
"""Vertical field of view, rad. Chosen."""
MIN_EXTENT_M = 4.0
"""Smallest extent in view, m. Chosen."""
MIN_ASPECT = 0.3
"""Smallest width to height of a window that is taken into account. Chosen."""
PANEL_PX = 320
"""Width of the panels on both sides of the scene, pixels. Chosen."""
PHONE_PX = 576
"""Width of a window below which viser puts all panels into a sheet at the bottom, pixels: 36 em."""
OVER_SHEET = 0.4
"""Share of the height of such a window above the sheet."""
MOVED_M = 0.1
"""Camera displacement above which the user has moved the camera, m. Chosen."""
RESIZED = 0.02
"""Change of width to height above which the window has been resized. Chosen."""


class Framing:
    """Keeps a rectangle of floor, (north, east), m, in view until the user moves the camera."""

    def __init__(self, server: ViserServer, least_ne_m: Vector2, most_ne_m: Vector2) -> None:
        self._server = server
        self._extent = least_ne_m, most_ne_m
        self._placed: dict[int, tuple[Vector3, float]] = {}
        """Camera position (ENU, m) set for each client, and its window's width to height."""
        self._phones: set[int] = set()
        """Clients whose lower part is under a sheet."""
        server.on_client_connect(self._welcome)
        server.on_client_disconnect(self._forget)

    def frame(self, least_ne_m: Vector2, most_ne_m: Vector2) -> None:
        self._extent = least_ne_m, most_ne_m
        self.all_in_view()

    def all_in_view(self) -> None:
        for client in self._server.get_clients().values():
            self._place(client)

    def _welcome(self, client: ClientHandle) -> None:
        # the panels have not opened, so the scene is as wide as the window
        if client.camera.image_width < min(PHONE_PX, client.camera.image_height):
            self._phones.add(client.client_id)
        self._place(client)
        client.camera.on_update(lambda camera: self._follow_window(client, camera))

    def _forget(self, client: ClientHandle) -> None:
        self._placed.pop(client.client_id, None)

    def _follow_window(self, client: ClientHandle, camera: CameraHandle) -> None:
        """Place the camera again after a resize, for example when panels open.

        A camera that the user has moved stays where it is.
        """
        place, aspect = self._placed.get(client.client_id, ((0.0, 0.0, 0.0), camera.aspect))
        is_where_put = np.allclose(camera.position, place, atol=MOVED_M)
        if is_where_put and abs(camera.aspect - aspect) > RESIZED:
            self._place(client)

    def _place(self, client: ClientHandle) -> None:
        camera = client.camera
        share = OVER_SHEET if client.client_id in self._phones else 1.0
        centre, distance_m = _framed(*self._extent, camera.aspect, share)
        eye = _eye(centre, distance_m)
        self._placed[client.client_id] = eye, camera.aspect
        with client.atomic():
            camera.fov = FIELD_RAD
            camera.position = eye
            camera.look_at = centre


def _framed(
    least_ne_m: Vector2, most_ne_m: Vector2, aspect: float, share: float
) -> tuple[Vector3, float]:
    """Point looked at (ENU, m), and its distance from the camera, m.

    The whole rectangle is in view, in the upper `share` of the window.
    """
    (south, west), (north, east) = least_ne_m, most_ne_m
    deep_m = max(north - south, MIN_EXTENT_M)
    wide_m = max(east - west, MIN_EXTENT_M)
    half = math.tan(FIELD_RAD / 2)
    # the near edge is closer to the camera than the centre and appears wider
    nearer_m = 0.5 * deep_m * math.cos(ELEVATION_RAD)
    for_width_m = 0.5 * wide_m / (half * max(aspect, MIN_ASPECT)) + nearer_m
    for_depth_m = 0.5 * deep_m * math.sin(ELEVATION_RAD) / (half * share) + nearer_m
    distance_m = 1.08 * max(for_width_m, for_depth_m)
    below_m = (1 - share) * half * distance_m / math.sin(ELEVATION_RAD)
    return ((west + east) / 2, (south + north) / 2 - below_m, 0.0), distance_m


def _eye(centre: Vector3, distance_m: float) -> Vector3:
    south_m, up_m = math.cos(ELEVATION_RAD) * distance_m, math.sin(ELEVATION_RAD) * distance_m
    east, north, floor = centre
    return east, north - south_m, floor + up_m
