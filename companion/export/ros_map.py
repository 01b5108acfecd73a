"""Writes a map for ROS map_server: a PGM of the cells and a YAML file with their position.

x east, y north, origin at take-off. https://wiki.ros.org/map_server
"""

from pathlib import Path

import numpy as np

from companion.export.cells import CELL_M, FREE, OCCUPIED, UNKNOWN, cells
from companion.export.plan.survey import Survey

GREY = {UNKNOWN: 205, FREE: 254, OCCUPIED: 0}
"""Grey values, 0 to 255, as map_server writes them."""


def write_ros_map(survey: Survey, path: Path) -> None:
    """Write the PGM to `path` and the YAML file beside it."""
    drawn = cells(survey.plan)
    greys = np.array([GREY[state] for state in sorted(GREY)], dtype=np.uint8)
    picture = greys[drawn.states[::-1]]
    rows, columns = picture.shape
    path.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + picture.tobytes())
    x_m, y_m = drawn.corner_enu_m
    path.with_suffix(".yaml").write_text(
        f"image: {_quoted(path.name)}\n"
        f"resolution: {CELL_M}\n"
        f"origin: [{x_m:.3f}, {y_m:.3f}, 0.0]\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n",
        encoding="utf-8",
    )


def _quoted(text: str) -> str:
    """Double-quoted YAML string: a file name may contain #, colons or quotes."""
    return '"' + "".join(_escaped(letter) for letter in text) + '"'


def _escaped(letter: str) -> str:
    if letter in '"\\':
        return f"\\{letter}"
    if " " <= letter <= "~":
        return letter
    return f"\\U{ord(letter):08x}" if ord(letter) > 0xFFFF else f"\\u{ord(letter):04x}"
