"""Writes the map as files: JSON for programs, PNG for people, PLY for 3-D viewers.

JSON uses the local NED frame; PLY uses ENU, as its readers expect; PNG has the main walls upright.
Every file is written under a temporary name and then renamed, so that a crash never leaves an
incomplete file.
"""

import contextlib
import json
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from companion.core.background_writer import BackgroundWriter
from companion.core.errors import CompanionError, OutputError, RecordingError
from companion.core.frames import Vector2, ned_to_enu
from companion.core.messages import FloorPlan, Pose, Surface, WallSegment
from companion.core.textfile import read_text
from companion.export.map_png import draw
from companion.export.map_record import check_version, in_json, map_record

_T = TypeVar("_T")

UNKNOWN_CEILING_M = 2.5
"""Height of drawn walls if the up beam never detected a ceiling, m. Chosen."""
WALL_COLOUR = (90, 110, 130, 255)
HIT_COLOUR = (230, 120, 40, 255)
"""Colours of walls and hits in the PLY file, RGBA, 0 to 255. Chosen."""
PLY_HEADER = """ply
format binary_little_endian 1.0
element vertex {vertices}
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property uchar alpha
element face {faces}
property list uchar int vertex_indices
end_header
"""
"""Begin of the PLY file. A library that writes it takes longer to load than all else at the end."""


def save(plan: FloorPlan, folder: Path, unfinished: str = "") -> list[Path]:
    """Write map.json, map.png and map.ply and return their paths; one failure stops no other.

    `unfinished`: why the mission was not completed; empty if it was.

    Raises:
        OutputError: a file cannot be written; the message names every such file.
    """
    paths = [folder / name for name in MAP_WRITERS]

    def write(name: str, content: FloorPlan, path: Path) -> None:
        MAP_WRITERS[name](content, path, unfinished)

    each_by_itself(partial(save_as, partial(write, path.name), plan, path) for path in paths)
    return paths


def each_by_itself(writings: Iterable[Callable[[], object]]) -> None:
    """Call each writer; one failure stops no other.

    Raises:
        OutputError: a file cannot be written; the message names every such file.
    """
    complaints = []
    for write in writings:
        try:
            write()
        except CompanionError as error:
            complaints.append(str(error))
    if complaints:
        raise OutputError("; ".join(complaints))


def save_as(write: Callable[[_T, Path], object], content: _T, path: Path) -> None:
    """Write a file under a temporary name in the same folder, then rename it.

    Raises:
        OutputError: the file cannot be written; the message names the file and the reason.
    """
    unfinished = path.with_name(f".unfinished-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(content, unfinished)
        unfinished.replace(path)
    except Exception as error:  # a library may raise anything
        with contextlib.suppress(OSError):
            unfinished.unlink(missing_ok=True)
        if isinstance(error, CompanionError):
            raise
        reason = (error.strerror or error) if isinstance(error, OSError) else repr(error)
        raise OutputError(f"{path}: {reason}") from error


def save_json(plan: FloorPlan, path: Path) -> None:
    """Write walls with their standard deviations, and the path; local NED, m, rad, s."""
    path.write_text(in_json(map_record(plan)), encoding="utf-8")


def load_json(path: Path) -> FloorPlan:
    """Read a map that `save_json` wrote, of this version or before; it does not contain hits.

    Raises:
        RecordingError: it is no map, or a later version wrote it.
    """
    record = json.loads(read_text(path))
    if not isinstance(record, dict):
        raise RecordingError(f"{path}: is no map; give map.json")
    check_version(record, path)
    return FloorPlan(
        walls=tuple(
            WallSegment(
                tuple(w["start_ne_m"]),
                tuple(w["end_ne_m"]),
                w["sigma_m"],
                w["hits"],
                w["normal_sigma_rad"],
            )
            for w in record["walls"]
        ),
        path=tuple(Pose(**pose) for pose in record["path"]),
        ceiling_m=record["ceiling_m"],
        floor_m=record["floor_m"],
        tops=tuple(
            Surface(tuple(s["centre_ne_m"]), s["height_m"], s["area_m2"]) for s in record["tops"]
        ),
    )


def save_ply(plan: FloorPlan, path: Path) -> None:
    """Write walls from floor to ceiling as faces, hits as points; ENU, m, z = 0 at take-off."""
    ceiling_m = plan.ceiling_m if plan.ceiling_m is not None else UNKNOWN_CEILING_M
    corners = [corner for wall in plan.walls for corner in _wall_corners(wall, ceiling_m)]
    points = [ned_to_enu(hit.position_ned_m) for hit in plan.hits]
    vertices = np.zeros(len(corners) + len(points), [("enu_m", "<f4", 3), ("rgba", "u1", 4)])
    vertices["enu_m"] = np.array([*corners, *points]).reshape(-1, 3)
    vertices["rgba"][: len(corners)] = WALL_COLOUR
    vertices["rgba"][len(corners) :] = HIT_COLOUR
    faces = np.zeros(2 * len(plan.walls), [("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"] = 3
    first = 4 * np.arange(len(plan.walls))
    faces["vertices"] = (first[:, None, None] + [(0, 1, 2), (0, 2, 3)]).reshape(-1, 3)
    header = PLY_HEADER.format(vertices=len(vertices), faces=len(faces))
    path.write_bytes(header.encode("ascii") + vertices.tobytes() + faces.tobytes())


def _wall_corners(wall: WallSegment, ceiling_m: float) -> list[tuple[float, float, float]]:
    def corner(end: Vector2, height_m: float) -> tuple[float, float, float]:
        return ned_to_enu((end[0], end[1], -height_m))

    start, end = wall.start_ne_m, wall.end_ne_m
    return [
        corner(start, 0.0),
        corner(end, 0.0),
        corner(end, ceiling_m),
        corner(start, ceiling_m),
    ]


MAP_WRITERS: Mapping[str, Callable[[FloorPlan, Path, str], None]] = {
    "map.json": lambda plan, path, _: save_json(plan, path),
    "map.png": draw,
    "map.ply": lambda plan, path, _: save_ply(plan, path),
}
"""Writer of each file of a flight; the text is why the mission was not completed."""


class AutoSave:
    """Saves map.json periodically during the flight, so that a crash loses little of the map.

    A separate thread writes the file. A write error is reported once; later writes retry.
    """

    PERIOD_S = 5.0
    """Time between saves, s. Chosen."""
    AT_ONCE_S = 1.0
    """Longest wait for a save after an error in flight, s. Chosen: recovery must start soon."""
    SETTLE_S = 5.0
    """Longest wait for the last write to finish, s. Chosen."""

    def __init__(
        self, folder: Path, plan: Callable[[], FloorPlan], warn: Callable[[str], None]
    ) -> None:
        self._plan = plan
        self._warn = warn
        self._has_warned = False
        self._last_s = 0.0
        path = folder / "map.json"
        self._writer = BackgroundWriter[FloorPlan](lambda plan: save_as(save_json, plan, path))

    def update(self, time_s: float) -> None:
        if self._writer.trouble and not self._has_warned:
            self._has_warned = True
            self._warn(f"the map so far is not saved: {self._writer.trouble}")
        if time_s - self._last_s < self.PERIOD_S:
            return
        self._last_s = time_s
        self._give()

    def save_at_once(self) -> None:
        """Save after an error; wait at most `AT_ONCE_S` for the write."""
        self._give()
        self._writer.wait(self.AT_ONCE_S)

    def settle(self) -> None:
        """Wait at most `SETTLE_S` for a write in progress, before another writer uses the file."""
        self._writer.wait(self.SETTLE_S)

    def _give(self) -> None:
        try:
            plan = self._plan()
        except Exception as error:  # a failed map must not end the flight
            self._writer.trouble = repr(error)
            return
        self._writer.write(plan)
