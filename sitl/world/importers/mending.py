"""Cleans triangles for collision checks: (n, 3, 3) of corners, z up, m."""

from collections.abc import Callable

import numpy as np

from companion.core.arrays import Array, Indices
from sitl.world.format import WorldError
from sitl.world.importers import FARTHEST_M

MIN_AREA_M2 = 1e-10
"""Smaller triangles are dropped, m². Chosen."""
MAX_EXTENT_M = 500.0
"""Largest side of a building, m. Chosen."""
MIN_HEIGHT_M, MAX_HEIGHT_M = 0.5, 100.0
"""Range of a building's height, m. Chosen."""
SLAB_M = 0.5
"""Thickest floor slab, m, limited to a quarter of the building's height. Chosen."""
FLOOR_SHARE = 0.6
"""Smallest area of a slab's top as a share of its underside; the rest is walls. Chosen."""


def mended(triangles: Array, source: str, report: Callable[[str], None]) -> Array:
    """Usable triangles, each once, with the floor at z = 0.

    Raises:
        WorldError: no triangle remains, or its size is not that of a building.
    """
    finite = triangles[np.isfinite(triangles).all(axis=(1, 2))]
    if len(finite):
        _check_place(finite, source)
    large = finite[_area_m2(finite) > MIN_AREA_M2]
    single = _once(large)
    for what, before, after in (
        ("not finite", triangles, finite),
        ("without area", finite, large),
        ("repeated", large, single),
    ):
        if len(after) < len(before):
            report(f"left out {len(before) - len(after)} of {len(triangles)} triangles: {what}")
    if not len(single):
        raise WorldError(f"{source}: none of {len(triangles)} triangles is usable")
    return _on_its_floor(single, source, report)


def numbered(triangles: Array) -> tuple[Array, Indices]:
    """Unique vertices (n, 3), and faces (m, 3)."""
    vertices, number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, number.reshape(-1, 3).astype(np.int64)


def _check_place(triangles: Array, source: str) -> None:
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    with np.errstate(over="ignore"):
        size = high - low
    if size.max() > MAX_EXTENT_M:
        measures = " × ".join(f"{side:.4g}" for side in size)
        raise WorldError(
            f"{source}: measures {measures} m, {MAX_EXTENT_M:g} m at most; "
            "if these are millimetres, scale it by 0.001; if centimetres, by 0.01"
        )
    farthest_m = float(np.abs([low[:2], high[:2]]).max())
    if farthest_m > FARTHEST_M:
        raise WorldError(
            f"{source}: lies {farthest_m:.4g} m from its origin, {FARTHEST_M:g} m at most; "
            "move it nearer"
        )


def _area_m2(triangles: Array) -> Array:
    a, b, c = triangles.swapaxes(0, 1)
    area: Array = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return area


def _once(triangles: Array) -> Array:
    """Triangles without repetitions; the order of corners is ignored."""
    _, faces = numbered(triangles)
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return triangles[np.sort(first)]


def _on_its_floor(triangles: Array, source: str, report: Callable[[str], None]) -> Array:
    lowest_m, highest_m = triangles[..., 2].min(), triangles[..., 2].max()
    floor_m = _floor_m(triangles, lowest_m, min(SLAB_M, (highest_m - lowest_m) / 4))
    if floor_m - lowest_m > 0.001:
        report(f"floor set {floor_m - lowest_m:.2f} m above the lowest point, on its slab")
    height_m = highest_m - floor_m
    if not MIN_HEIGHT_M <= height_m <= MAX_HEIGHT_M:
        raise WorldError(
            f"{source}: is {height_m:.3g} m high; should be {MIN_HEIGHT_M:g} to "
            f"{MAX_HEIGHT_M:g} m; check its unit, metres, and which axis is up"
        )
    on_floor: Array = triangles - np.array([0.0, 0.0, floor_m])
    return on_floor


def _floor_m(triangles: Array, lowest_m: float, slab_m: float) -> float:
    """Height of the lowest point, or of the top of its slab, m."""
    z_m = triangles[..., 2]
    is_level = (np.ptp(z_m, axis=1) < 0.001) & (z_m.max(axis=1) < lowest_m + slab_m)
    if not is_level.any():
        return lowest_m
    _, level = np.unique(z_m[is_level, 0].round(3), return_inverse=True)
    area_m2 = np.bincount(level, _area_m2(triangles[is_level]))
    top = np.flatnonzero(area_m2 >= FLOOR_SHARE * area_m2.max())[-1]
    return float(z_m[is_level][level == top].max())
