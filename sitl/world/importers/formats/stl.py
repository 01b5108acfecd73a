"""Reads STL: binary if the file size matches its number of triangles, else text.

Some programs append a few bytes to a binary file: less than one triangle more is no triangle.
"""

import codecs
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sitl.world.importers.formats import MeshError, Part

HEADER_BYTES = 84
"""Length of a binary file's header, bytes: 80 of text and a 32-bit number of triangles."""
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""One triangle of a binary file, 50 bytes, little-endian."""
NAME = re.compile(rb"(?im)^\s*(?:end)?solid\b.*$")
CORNER = re.compile(rb"(?i)\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")
FACETS = re.compile(rb"(?i)\bfacet\b")


def read_stl(data: bytes, path: Path) -> Iterator[Part]:
    """Read the triangles.

    Raises:
        MeshError: the number of triangles is not the declared one.
    """
    data = data.removeprefix(codecs.BOM_UTF8)
    declared = int.from_bytes(data[80:HEADER_BYTES], "little")
    appended = len(data) - HEADER_BYTES - declared * FACET.itemsize
    if len(data) >= HEADER_BYTES and 0 <= appended < FACET.itemsize:
        facets = np.frombuffer(data, FACET, declared, HEADER_BYTES)
        corners = facets["corners"].astype(float)
    elif data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        corners = _text(data)
    else:
        held = max(len(data) - HEADER_BYTES, 0) / FACET.itemsize
        raise MeshError(
            f"declares {declared} triangles and holds {held:g}: it is cut short or damaged; "
            "export it again"
        )
    vertices = corners.reshape(-1, 3)
    yield Part(vertices, np.arange(len(vertices)).reshape(-1, 3))


def _text(data: bytes) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    *_, last = data.rstrip().splitlines()
    if not last.split()[:1] or last.split()[0].lower() != b"endsolid":
        raise MeshError("ends without endsolid: it is cut short; export it again")
    body = NAME.sub(b"", data)  # a name may contain any words
    corners = np.array([[float(x) for x in corner] for corner in CORNER.findall(body)])
    facets = len(FACETS.findall(body))
    if len(corners) != 3 * facets:
        raise MeshError(
            f"has {len(corners)} corners for {facets} facets, which should be triangles; "
            "export it again"
        )
    return corners
