"""Reads Wavefront OBJ: vertices and faces; ignores names, normals, textures and lines."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from companion.core.textfile import encoding_of
from sitl.world.importers.formats import MeshError, Part, part
from sitl.world.importers.formats.polygons import triangles

NOT_READ = {
    "surf": "free-form surfaces",
    "bsp": "free-form surfaces",
    "bzp": "free-form surfaces",
    "cdp": "free-form surfaces",
    "call": "parts in other files",
}
"""Statements that would add faces."""
READ = ("v", "f", "fo")
"""Statements that are read: vertices and faces."""
NOWHERE = -1
"""Number of a vertex that does not exist."""


def read_obj(data: bytes, path: Path) -> Iterator[Part]:
    """Read the triangles.

    Raises:
        MeshError: a line is invalid, or adds faces of a kind that is not supported.
    """
    vertices: list[tuple[float, float, float]] = []
    polygons: list[list[int]] = []
    # comments and names may have any encoding and are ignored
    text = data.decode(encoding_of(data), "replace").replace("\r\n", "\n").replace("\r", "\n")
    for number, line in _statements(text):
        keyword, *words = line.split() or ("",)
        try:
            if keyword == "v":
                x, y, z = map(float, words[:3])
                vertices.append((x, y, z))
            elif keyword in {"f", "fo"}:
                polygons.append(_corners(words, len(vertices)))
        except ValueError as error:
            raise MeshError(
                f"line {number}: {line.strip()[:40]!r} is not a valid {keyword}"
            ) from error
        if keyword in NOT_READ:
            kind = NOT_READ[keyword]
            raise MeshError(f"line {number}: {kind} ({keyword}) are not read; export triangles")
    yield part(vertices, (face for corners in polygons for face in triangles(corners, vertices)))


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Statements without comments, and the line on which each begins.

    A backslash at the end continues a statement that is read. At the end of a comment or a name it
    is that of a Windows folder.
    """
    begun = ""
    first = 1
    for number, line in enumerate(text.split("\n"), start=1):
        first = first if begun else number
        statement = (begun + line).partition("#")[0].rstrip()
        begun = ""
        if statement.endswith("\\") and statement.split()[0] in READ:
            begun = statement[:-1] + " "
        else:
            yield first, statement
    if begun:
        yield first, begun


def _corners(words: Sequence[str], vertices: int) -> list[int]:
    """Vertex numbers from 0. The file counts from 1, or back from the latest vertex."""
    numbers = [int(word.partition("/")[0]) for word in words]
    if not numbers:
        raise ValueError("no corners")
    return [n - 1 if n > 0 else max(vertices + n, NOWHERE) if n < 0 else NOWHERE for n in numbers]
