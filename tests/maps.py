"""Draws occupancy maps for tests: rows northwards, cells of 5 cm, as in a robot's map."""

from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

CELL_M = 0.05
FREE, UNKNOWN, WALL = 254, 205, 0
Shades = NDArray[np.uint8]


def cells(length_m: float) -> int:
    return round(length_m / CELL_M)


def nothing(north_m: float, east_m: float) -> Shades:
    """A map of unknown cells only."""
    return np.full((cells(north_m), cells(east_m)), UNKNOWN, dtype=np.uint8)


def fill(  # noqa: PLR0917 - four sides, as on a drawing
    shades: Shades, south_m: float, west_m: float, north_m: float, east_m: float, shade: int
) -> None:
    shades[cells(south_m) : cells(north_m), cells(west_m) : cells(east_m)] = shade


def room(shades: Shades, south_m: float, west_m: float, north_m: float, east_m: float) -> None:
    """Draw a room: free within these sides, with walls of 10 cm around."""
    fill(shades, south_m - 0.1, west_m - 0.1, north_m + 0.1, east_m + 0.1, WALL)
    fill(shades, south_m, west_m, north_m, east_m, FREE)


def write(folder: Path, shades: Shades, yaw_rad: float = 0.0) -> str:
    """Write map_server's YAML file with its image; return its path."""
    Image.fromarray(np.flipud(shades)).save(folder / "house.pgm")
    record = {
        "image": "house.pgm",
        "resolution": CELL_M,
        "origin": [0.0, 0.0, yaw_rad],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    path = folder / "house.yaml"
    path.write_text(yaml.safe_dump(record))
    return str(path)
