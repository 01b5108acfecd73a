"""Where the page looks from: south of what is shown and above it, all of it in view."""

import math

from viser import ClientHandle

from companion.frames import Vector2, Vector3

ELEVATION_RAD = math.radians(58)
FIELD_RAD = math.radians(40)
LEAST_EXTENT_M = 4.0
PANEL_PX = 320
"""Of the panels on either side, which lie over the scene."""
LEAST_SEEN_SHARE = 0.4


def look_at(client: ClientHandle, least_ne_m: Vector2, most_ne_m: Vector2) -> None:
    """Frame a rectangle of floor, (north, east)."""
    camera = client.camera
    seen_share = max(1 - 2 * PANEL_PX / max(camera.image_width, 1), LEAST_SEEN_SHARE)
    centre, distance_m = _framed(least_ne_m, most_ne_m, seen_share * camera.aspect)
    with client.atomic():
        camera.fov = FIELD_RAD
        camera.position = _eye(centre, distance_m)
        camera.look_at = centre


def _framed(least_ne_m: Vector2, most_ne_m: Vector2, aspect: float) -> tuple[Vector3, float]:
    """The middle in ENU, and from how far all is seen."""
    (south, west), (north, east) = least_ne_m, most_ne_m
    deep_m = max(north - south, LEAST_EXTENT_M)
    wide_m = max(east - west, LEAST_EXTENT_M)
    half = math.tan(FIELD_RAD / 2)
    # the near edge stands nearer to the eye, and so wider, than the middle
    nearer_m = 0.5 * deep_m * math.cos(ELEVATION_RAD)
    for_width_m = 0.5 * wide_m / (half * max(aspect, 0.3)) + nearer_m
    for_depth_m = 0.5 * deep_m * math.sin(ELEVATION_RAD) / half + nearer_m
    return ((west + east) / 2, (south + north) / 2, 0.0), 1.04 * max(for_width_m, for_depth_m)


def _eye(centre: Vector3, distance_m: float) -> Vector3:
    south_m, up_m = math.cos(ELEVATION_RAD) * distance_m, math.sin(ELEVATION_RAD) * distance_m
    east, north, floor = centre
    return east, north - south_m, floor + up_m
