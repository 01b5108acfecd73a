"""Cleans the walls of an imported plan: specks, dotted lines, and the waves of curtains.

    specks          ▪    ▪  ▪        left out: noise of a sensor, legs of chairs
    dotted lines    ▪ ▪ ▪ ▪ ▪ ▪      joined to one wall: a railing, or a wall seen in parts
    curtains        ╱╲╱╲╱╲╱╲         smoothed, with the steps of cells, to straight walls

A flight through the cleaned world is easier than one through the original.
"""

from collections.abc import Callable, Iterable

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from companion.core.arrays import Array, Indices
from sitl.world.format import MIN_LENGTH_M, Segment, Walls, World, WorldError
from sitl.world.geometry.polylines import join, legs, simplify

SPECK_M = 0.25
"""Largest diagonal of a speck, m. Chosen: a chair's leg in cells of 5 cm, not a pillar."""
DOT_GAP_M, MIN_DOTS, ON_LINE_M = 0.5, 4, 0.05
"""A dotted line: largest distance of its dots, m; least number of dots; largest RMS distance of
them from the line, m. Chosen: the drone does not fit between such dots."""
SMOOTH_M = 0.08
"""Largest distance by which a wall is moved, m. Chosen: below the error of a map of 10 cm that
still counts as right."""
SAME_WITHIN_M = 0.02
"""Ends of walls within this distance meet, m. Chosen."""


def cleaned(world: World, report: Callable[[str], None]) -> World:
    """The world with cleaned walls; `report` receives what was done.

    Walls with thickness, doors, glass or heights of their own stay: somebody drew them.

    Raises:
        WorldError: the world is a mesh, or nothing but specks.
    """
    if world.mesh is not None:
        raise WorldError(f"{world.name}: only plans of walls can be cleaned, not meshes")
    plain = [walls for walls in world.walls if _is_plain(walls)]
    drawn = [walls for walls in world.walls if not _is_plain(walls)]
    segments = [segment for walls in plain for segment in walls.segments]
    lines = join(np.array(segments, dtype=float).reshape(-1, 2, 2), SAME_WITHIN_M)
    walls, specks = _by_size(lines)
    joined = _dotted_lines(specks)
    smoothed = _once(leg for line in walls for leg in legs(simplify(line, SMOOTH_M)))
    before = sum(len(line) - 1 for line in walls)
    dots = sum(count for _, count in joined)
    if len(specks) > dots:
        report(f"left out {len(specks) - dots} specks of up to {SPECK_M:g} m")
    if joined:
        length_m = sum(float(np.hypot(*np.subtract(*segment))) for segment, _ in joined)
        report(f"joined {dots} dots to {len(joined)} walls of {length_m:.1f} m in all")
    if len(smoothed) < before:
        report(f"smoothed {before} walls to {len(smoothed)}, moved by up to {SMOOTH_M:g} m")
    new = [Walls(points=segment) for segment in (*smoothed, *(segment for segment, _ in joined))]
    if not new and not drawn and not world.boxes:
        raise WorldError(f"{world.name}: all its walls are specks; check the unit, metres")
    return world.model_copy(update={"walls": (*drawn, *new)})


def _is_plain(walls: Walls) -> bool:
    return walls == Walls(points=walls.points, closed=walls.closed)


def _by_size(lines: list[Array]) -> tuple[list[Array], list[Array]]:
    """The lines of walls, and the centres (2,) of specks: connected lines of little extent."""
    ends = np.array([(line[0], line[-1]) for line in lines]).reshape(-1, 2)
    keys = np.round(ends / SAME_WITHIN_M).astype(np.int64)
    _, corner = np.unique(keys, axis=0, return_inverse=True)
    pairs = corner.reshape(-1, 2)
    _, piece_of_corner = _connected(pairs, int(corner.max(initial=-1)) + 1)
    piece = piece_of_corner[pairs[:, 0]]
    walls, specks = [], []
    for number in np.unique(piece):
        own = [lines[at] for at in np.flatnonzero(piece == number)]
        points = np.concatenate(own)
        low, high = points.min(axis=0), points.max(axis=0)
        if np.hypot(*(high - low)) <= SPECK_M:
            specks.append((low + high) / 2)
        else:
            walls += own
    return walls, specks


def _dotted_lines(specks: list[Array]) -> list[tuple[Segment, int]]:
    """The walls that rows of specks make, and the number of specks of each."""
    centres = np.array(specks).reshape(-1, 2)
    if not len(centres):
        return []
    pairs = cKDTree(centres).query_pairs(DOT_GAP_M, output_type="ndarray")
    count, row = _connected(pairs, len(centres))
    found = []
    for number in range(count):
        dots = centres[row == number]
        if len(dots) < MIN_DOTS:
            continue
        middle = dots.mean(axis=0)
        _, _, (along, across) = np.linalg.svd(dots - middle)
        if np.sqrt(np.mean(((dots - middle) @ across) ** 2)) > ON_LINE_M:
            continue
        at_m = (dots - middle) @ along
        start, end = ((middle + m * along).tolist() for m in (at_m.min(), at_m.max()))
        found.append((((start[0], start[1]), (end[0], end[1])), len(dots)))
    return found


def _connected(pairs: Indices, count: int) -> tuple[int, Indices]:
    """Number of components of a graph, and the component of each of its `count` nodes."""
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    components, label = connected_components(links, directed=False)
    return int(components), label.astype(np.int64)


def _once(segments: Iterable[Segment]) -> list[Segment]:
    """The segments without repetitions and tiny ones; the order of the ends is ignored."""
    single = {frozenset(segment): segment for segment in segments}
    return [each for each in single.values() if np.hypot(*np.subtract(*each)) > MIN_LENGTH_M]
