"""Writes the hits as a point cloud, PLY or PCD: ENU, m, z = 0 on the floor at take-off."""

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from companion.core.errors import OutputError
from companion.core.frames import ned_to_enu
from companion.export.plan.survey import Survey


def points_enu_m(survey: Survey) -> NDArray[np.float32]:
    """Hits, (n, 3), ENU, m."""
    points = [ned_to_enu(hit.position_ned_m) for hit in survey.plan.hits]
    return np.array(points, dtype=np.float32).reshape(-1, 3)


def write_ply(survey: Survey, path: Path) -> None:
    """Write a point cloud as PLY.

    Raises:
        OutputError: the map has no hits; the library cannot write an empty cloud.
    """
    if not survey.plan.hits:
        raise OutputError(f"{path}: the map has no points")
    with path.open("wb") as file:
        trimesh.PointCloud(points_enu_m(survey)).export(file, file_type="ply")


def write_pcd(survey: Survey, path: Path) -> None:
    """Write a point cloud as PCD version 0.7, binary.

    https://pointclouds.org/documentation/tutorials/pcd_file_format.html
    """
    points = points_enu_m(survey)
    header = {
        "VERSION": "0.7",
        "FIELDS": "x y z",
        "SIZE": "4 4 4",
        "TYPE": "F F F",
        "COUNT": "1 1 1",
        "WIDTH": len(points),
        "HEIGHT": 1,
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": len(points),
        "DATA": "binary",
    }
    lines = "".join(f"{key} {entry}\n" for key, entry in header.items())
    path.write_bytes(lines.encode() + points.astype("<f4").tobytes())
