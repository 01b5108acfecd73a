"""Imports buildings as triangles: STL, OBJ, PLY, GLB and glTF, in m.

STL, OBJ and PLY define no directions: x is east, y north, z up. In GLB and glTF y is up by
definition; x is then east and z south. Transforms of nodes are applied, materials are ignored.
Starts are places with clearance at 1.2 m and a free column up to there.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.textfile import reason
from sitl.world.format import World, WorldError
from sitl.world.geometry.model import WorldModel
from sitl.world.geometry.triangles import Mesh
from sitl.world.importers.formats import MeshError, Part
from sitl.world.importers.formats.gltf import read_gltf
from sitl.world.importers.formats.obj import read_obj
from sitl.world.importers.formats.ply import read_ply
from sitl.world.importers.formats.stl import read_stl
from sitl.world.importers.mending import mended, numbered
from sitl.world.importers.starts import MIN_CLEARANCE_M, free_starts

MAX_BYTES = 200_000_000
"""Largest file, bytes. Chosen."""
MAX_TRIANGLES = 500_000
"""Largest number of triangles. Chosen."""
PLAN_HEIGHT_M = 1.2
"""Height of the plan, m: the usual flight height."""
WAY_UP_M = (0.3, 0.5, 0.7, 0.9, 1.1)
"""Heights at which the column above a start is checked, m."""
WAY_UP_CLEARANCE_M = 0.3
"""Smallest clearance in that column, m. Chosen."""

Y_UP_SUFFIXES = (".glb", ".gltf")
ENU_FROM_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from glTF's axes, y up, to east, north, up: z is south."""
NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Rotation from east, north, up to north, east, down."""
READERS: Mapping[str, Callable[[bytes, Path], Iterable[Part]]] = {
    ".stl": read_stl,
    ".obj": read_obj,
    ".ply": read_ply,
    ".glb": read_gltf,
    ".gltf": read_gltf,
}
"""Readers by the file's suffix in lower case."""


def load_mesh(path: Path, report: Callable[[str], None]) -> World:
    """Read a mesh.

    Raises:
        WorldError: the file cannot be read, or is not a building.
    """
    triangles = mended(_read(path, report), str(path), report)
    vertices, faces = numbered(triangles @ NED_FROM_ENU.T)
    mesh = Mesh(vertices, faces)
    parts = {"name": path.stem, "height_m": -float(vertices[:, 2].min()), "mesh": mesh}
    return World.model_validate({**parts, "starts": _starts(parts, mesh, str(path))})


def _read(path: Path, report: Callable[[str], None]) -> Array:
    """Triangles of all parts, east, north, up; faces without existing vertices are dropped."""
    suffix = path.suffix.lower()
    placed: list[Array] = []
    count = 0
    try:
        if path.stat().st_size > MAX_BYTES:
            raise WorldError(f"{path}: larger than {MAX_BYTES // 10**6} MB; decimate the mesh")
        with np.errstate(all="ignore"):  # non-finite values are dropped and reported later
            for part in READERS[suffix](path.read_bytes(), path):
                count += len(part.faces)
                if count > MAX_TRIANGLES:
                    break
                placed.append(_corners(part))
    except WorldError:
        raise
    except MeshError as error:
        raise WorldError(f"{path}: {error}") from error
    except OSError as error:
        raise WorldError(f"{path}: {reason(error)}") from error
    except Exception as error:  # readers raise any exception on a damaged file
        raise WorldError(f"{path}: cannot be read: {error or type(error).__name__}") from error
    if not 0 < count <= MAX_TRIANGLES:
        raise WorldError(f"{path}: {count} triangles; there must be 1 to {MAX_TRIANGLES}")
    triangles = np.concatenate(placed)
    if suffix in Y_UP_SUFFIXES:
        triangles = triangles @ ENU_FROM_Y_UP.T
    if len(triangles) < count:
        report(f"left out {count - len(triangles)} of {count} triangles: corners that do not exist")
    return triangles


def _corners(part: Part) -> Array:
    """Triangles of one part, without those that refer to missing vertices."""
    vertices, faces = part
    exists = ((faces >= 0) & (faces < len(vertices))).all(axis=1)
    corners: Array = vertices[faces[exists]]
    return corners


def _starts(parts: dict[str, object], mesh: Mesh, source: str) -> list[dict[str, object]]:
    plan = mesh.section(PLAN_HEIGHT_M)
    if not plan:
        raise WorldError(f"{source}: nothing stands at {PLAN_HEIGHT_M} m above its floor")
    somewhere = {"name": "placeholder", "position": (0, 0)}
    model = WorldModel(World.model_validate({**parts, "starts": [somewhere]}))

    def is_free(place: Vector2) -> bool:
        return model.clearance_m((*place, -PLAN_HEIGHT_M)) >= MIN_CLEARANCE_M and all(
            model.clearance_m((*place, -height_m)) >= WAY_UP_CLEARANCE_M for height_m in WAY_UP_M
        )

    return free_starts(plan, source, is_free)
