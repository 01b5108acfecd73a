"""Imports maps of ROS map_server: a YAML file and an image (PGM or PNG) of the cells.

Dark cells are walls, light ones free, those between unknown. As in ROS, x is east and y north, and
`origin` is x, y and yaw of the image's lower left corner. Maps have no heights: walls reach a
ceiling at 2.6 m. A cell that is partly transparent is unknown, in every mode.

    files ─► cells ─► space: air, rooms ─┬─► starts
                └───► walls, without marks └─► border to the unknown, closed
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2
from sitl.world.format import MIN_LENGTH_M, Segment, World, WorldError
from sitl.world.geometry.polylines import legs
from sitl.world.importers import CEILING_M, FARTHEST_M, MAX_WALLS
from sitl.world.importers.contours import (
    borders,
    lengthened,
    outlines,
    roughness,
    straightened,
)
from sitl.world.importers.map_files import Grid, read_map
from sitl.world.importers.pieces import marks_outside, report_pieces
from sitl.world.importers.space import Space, enclosed, near, reached, space_of
from sitl.world.importers.starts import MIN_CLEARANCE_M, free_starts
from sitl.world.known import KnownArea
from sitl.world.plan import NARROWEST_DOOR_M

MAX_EDGES = 400_000
"""Largest number of cell edges along walls. A building has some ten thousand, noise millions."""
MAX_OUTLINES = 20_000
"""Largest number of separate outlines. Chosen."""
SAME_TO_DIGITS = 6
"""Decimals to which points in m are rounded before repeated walls are dropped."""
INTO_WALLS_CELLS = 1.5
"""Extension of the closed border into the walls at its ends, cells, so that no slit remains."""


def load_ros_map(path: Path, report: Callable[[str], None]) -> World:
    """Read a map.

    Raises:
        WorldError: the map cannot be read, or is not a building with a start.
    """
    grid = read_map(path)
    lines = _outlines(path, grid)
    space = space_of(grid.free, grid.occupied, grid.raster.cell_m)
    kept = space.kept
    marks = marks_outside(kept, grid.occupied, grid.raster.cell_m)
    if marks.any():
        grid = replace(grid, occupied=grid.occupied & ~marks)
        lines = outlines(grid.occupied)
    report_pieces(marks, kept, grid.occupied, report)
    _report_refused(space, report)
    segments = _walls(path, grid, lines, report)
    border, border_m = _border(path, grid, kept)
    world = World.model_validate(
        {
            "name": path.stem,
            "height_m": CEILING_M,
            "walls": [{"points": segment} for segment in segments],
            "starts": _starts(path, grid, space, segments, border),
        }
    )
    known = replace(_known(grid, kept, world.starts[0].position), border=border, border_m=border_m)
    return world.model_copy(update={"known": known})


def _outlines(path: Path, grid: Grid) -> list[Array]:
    """Outlines of the occupied cells; images of noise are rejected."""
    if not grid.occupied.any():
        raise WorldError(f"{path}: no cell is a wall; see negate, occupied_thresh and mode")
    is_noise = roughness(grid.occupied) > MAX_EDGES
    rough = [] if is_noise else outlines(grid.occupied)
    if is_noise or len(rough) > MAX_OUTLINES:
        raise WorldError(
            f"{path}: more than {MAX_OUTLINES} separate walls, or {MAX_EDGES} edges of cells; "
            "take out single cells, or see occupied_thresh"
        )
    return rough


def _walls(
    path: Path, grid: Grid, rough: list[Array], report: Callable[[str], None]
) -> list[Segment]:
    """The straightened outlines in m, each segment once."""
    segments, repeated = _pieces(grid, [straightened(line) for line in rough])
    if repeated:
        report(f"left out {repeated} of {repeated + len(segments)} walls: repeated or tiny")
    farthest_m = max((abs(x) for piece in segments for point in piece for x in point), default=0)
    if farthest_m > FARTHEST_M:
        raise WorldError(f"{path}: reaches {farthest_m:.0f} m; {FARTHEST_M:g} m at most")
    if not 0 < len(segments) <= MAX_WALLS:
        raise WorldError(f"{path}: {len(segments)} walls; there must be 1 to {MAX_WALLS}")
    return segments


def _pieces(grid: Grid, lines: list[Array]) -> tuple[list[Segment], int]:
    """Segments of polylines in m, each once, and the number of repeated or tiny ones."""
    placed = [grid.raster.to_plan(line).round(SAME_TO_DIGITS) for line in lines]
    pieces = [leg for line in placed for leg in legs(line)]
    long = [piece for piece in pieces if math.dist(*piece) > MIN_LENGTH_M]
    segments = list({frozenset(piece): piece for piece in long}.values())
    return segments, len(pieces) - len(segments)


def _border(path: Path, grid: Grid, kept: Mask) -> tuple[tuple[Segment, ...], float]:
    """Border between this air and the unknown, and its length in m.

    It extends into the walls at its ends, because straightened outlines are up to a cell off.
    """
    lines = [straightened(line) for line in borders(kept, ~(kept | grid.occupied))]
    seen, _ = _pieces(grid, lines)
    pieces, _ = _pieces(grid, [lengthened(line, INTO_WALLS_CELLS) for line in lines])
    if len(pieces) > MAX_WALLS:
        raise WorldError(f"{path}: {len(pieces)} pieces of border to unknown cells are too many")
    return tuple(pieces), sum(math.dist(*piece) for piece in seen)


def _starts(
    path: Path, grid: Grid, space: Space, segments: list[Segment], border: tuple[Segment, ...]
) -> list[dict[str, object]]:
    """Starts in the regions with enough room, with no unknown cells around them."""
    if not space.order:
        raise WorldError(f"{path}: no enclosed place is known to be free: {_why(grid, space)}")
    rank_of = space.rank()
    rank_of[near(~grid.free, MIN_CLEARANCE_M / grid.raster.cell_m - 0.5)] = -1

    def rank(places: Array) -> Indices:
        row, column = grid.raster.to_cells(places).T
        rows, columns = rank_of.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(inside, rank_of[np.where(inside, row, 0), np.where(inside, column, 0)], -1)

    def is_in_a_room(place: Vector2) -> bool:
        cell = grid.raster.to_cells(np.array([place]))
        return bool(enclosed(cell, space.air, grid.occupied)[0])

    return free_starts(segments, str(path), is_in_a_room, rank, border)


def _why(grid: Grid, space: Space) -> str:
    if not grid.free.any():
        return "no cell is free; see negate, free_thresh and mode"
    if not space.fits_m2:
        return f"nowhere are free cells as wide as a door, {NARROWEST_DOOR_M} m"
    return (
        f"all {space.fits_m2:.1f} m² where a drone fits border on unknown cells, like a fan seen "
        "through a doorway; map more of the building"
    )


def _report_refused(space: Space, report: Callable[[str], None]) -> None:
    """Report the areas where a drone fits but may not start."""
    fits = f"of {space.fits_m2:.1f} m² where a drone fits"
    if space.fan_m2 > 0:
        report(
            f"no start on {space.fan_m2:.1f} m² {fits}: they border on unknown cells, like a fan "
            "seen through a doorway"
        )
    if space.apart_m2 > 0:
        report(
            f"no start on {space.apart_m2:.1f} m² {fits}: no way leads there from the largest room"
        )


def _known(grid: Grid, kept: Mask, start: Vector2) -> KnownArea:
    """The map's known area, and the part of it that is reachable from a start."""
    cell_m = grid.raster.cell_m
    at = grid.raster.to_cells(np.array([start]))[0]
    flown = reached(kept, at, cell_m) & grid.free
    as_air = reached(~grid.occupied, at, cell_m)
    unknown, all_cells = (int(np.count_nonzero(x)) for x in (as_air & ~grid.free, as_air))
    return KnownArea(
        grid.raster,
        grid.free,
        grid.occupied,
        reached_m2=float(np.count_nonzero(flown)) * cell_m**2,
        unknown_share=unknown / max(1, all_cells),
    )
