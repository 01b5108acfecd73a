"""Imports plans as wall segments in JSON.

    {"name": ..., "units": "m", "walls": [[x1, y1, x2, y2], ...]}

x is east and y is north, m. A map of the companion, `map.json`, has walls from `start_ne_m` to
`end_ne_m` instead. There are no heights: walls reach a ceiling at 2.6 m. Real plans repeat
segments, cross them and leave gaps. Unusable walls are dropped and counted.
"""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from companion.core.errors import RecordingError
from companion.core.textfile import parsed_json, read_text, reason
from companion.export.map_record import FORMAT, check_version
from sitl.world.format import World, WorldError
from sitl.world.importers import CEILING_M, FARTHEST_M, MAX_WALLS
from sitl.world.importers.starts import free_starts

MIN_WALL_M = 0.01
"""Shorter walls are dropped, m. Chosen."""
SAME_TO_M = 0.001
"""Rounding at which equal segments are the same wall, m. Chosen."""

Number = tuple[float, float, float, float]


def load_segments(path: Path, report: Callable[[str], None]) -> World:
    """Read a plan.

    Raises:
        WorldError: the file cannot be read, or has no usable wall or start.
    """
    record = _read(path)
    walls = record.get("walls")
    if not isinstance(walls, list) or not walls:
        raise WorldError(f"{path}: walls: a list of [x1, y1, x2, y2] is needed")
    if len(walls) > MAX_WALLS:
        raise WorldError(f"{path}: walls: {len(walls)} are too many, {MAX_WALLS} at most")
    units = record.get("units", "m")
    if units != "m" and not isinstance(units, dict):  # a map has units of other quantities, too
        raise WorldError(f"{path}: units = {units!r}: should be 'm'")
    left_out: list[str] = []
    good = _mended([_as_list(wall) for wall in walls], left_out.append)
    if not good:
        raise WorldError(f"{path}: walls: none of {len(walls)} is usable: {'; '.join(left_out)}")
    for repair in left_out:
        report(repair)
    name = record.get("name")
    return World.model_validate(
        {
            "name": name if isinstance(name, str) else path.stem,
            "height_m": CEILING_M,
            "walls": [{"points": [(y1, x1), (y2, x2)]} for x1, y1, x2, y2 in good],
            "starts": free_starts([((y1, x1), (y2, x2)) for x1, y1, x2, y2 in good], str(path)),
        }
    )


def _read(path: Path) -> dict[str, Any]:
    try:
        record = parsed_json(read_text(path))
    except (OSError, ValueError, RecursionError) as error:
        raise WorldError(f"{path}: {reason(error)}") from error
    if not isinstance(record, dict):
        raise WorldError(f"{path}: not a plan: an object with walls is needed")
    if record.get("format") == FORMAT:
        try:
            check_version(record, path)
        except RecordingError as error:
            raise WorldError(str(error)) from error
    return record


def _as_list(wall: Any) -> Any:
    """A wall of a map as x1, y1, x2, y2; others are left as they are."""
    match wall:
        case {"start_ne_m": [north_a, east_a], "end_ne_m": [north_b, east_b]}:
            return [east_a, north_a, east_b, north_b]
        case _:
            return wall


def _mended(walls: list[Any], report: Callable[[str], None]) -> list[Number]:
    """The usable walls, each once; reports the number and reason of dropped ones."""
    numbers = [tuple(map(float, wall)) for wall in walls if _is_four_numbers(wall)]
    near = [wall for wall in numbers if max(map(abs, wall)) <= FARTHEST_M]
    long = [wall for wall in near if math.dist(wall[:2], wall[2:]) >= MIN_WALL_M]
    single = {_key(wall): wall for wall in long}
    for what, before, after in (
        ("not four finite numbers", walls, numbers),
        (f"farther than {FARTHEST_M:g} m, as if in millimetres", numbers, near),
        (f"shorter than {MIN_WALL_M:g} m", near, long),
        ("repeated", long, single),
    ):
        if len(after) < len(before):
            report(f"left out {len(before) - len(after)} of {len(walls)} walls: {what}")
    return [(x1, y1, x2, y2) for x1, y1, x2, y2 in single.values()]


def _is_four_numbers(wall: object) -> bool:
    return (
        isinstance(wall, list)
        and len(wall) == 4
        and all(isinstance(x, int | float) and abs(x) <= sys.float_info.max for x in wall)
    )


def _key(wall: tuple[float, ...]) -> frozenset[tuple[int, int]]:
    """A key that is the same for a wall and its reverse."""
    x1, y1, x2, y2 = (round(value / SAME_TO_M) for value in wall)
    return frozenset({(x1, y1), (x2, y2)})
