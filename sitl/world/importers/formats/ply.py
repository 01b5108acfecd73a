"""Reads PLY, text or binary: vertices, and faces or strips of triangles; ignores the rest."""

import codecs
import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

import numpy as np

from companion.core.arrays import Array
from sitl.world.importers.formats import MeshError, Part, part, strip
from sitl.world.importers.formats.polygons import triangles

KINDS = {
    **dict.fromkeys(("char", "int8"), "b"),
    **dict.fromkeys(("uchar", "uint8"), "B"),
    **dict.fromkeys(("short", "int16"), "h"),
    **dict.fromkeys(("ushort", "uint16"), "H"),
    **dict.fromkeys(("int", "int32"), "i"),
    **dict.fromkeys(("uint", "uint32"), "I"),
    **dict.fromkeys(("float", "float32"), "f"),
    **dict.fromkeys(("double", "float64"), "d"),
}
"""Types by both of their names, as letters of `struct`."""
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
END = re.compile(rb"[\r\n]end_header[ \t]*(?:\r\n|\r|\n|$)")
"""Last line of the header; a comment may contain the word."""
CORNERS = ("vertex_indices", "vertex_index")
END_OF_STRIP = -1
"""Index in `tristrips` that ends a strip."""
Row = list[list[float]]
"""Values of each property: one value, or those of a list."""


@dataclass(slots=True)
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)
    """Name, type, and for a list the type of its length."""

    @property
    def has_lists(self) -> bool:
        return any(length for _, _, length in self.properties)


def read_ply(data: bytes, path: Path) -> Iterator[Part]:
    """Read the triangles.

    Raises:
        MeshError: the file holds less or more than its header declares, or is invalid.
    """
    order, elements, body = _header(data)
    rows: _Words | _Bytes = _Bytes(body, order) if order else _Words(body)
    vertices: Array = np.empty((0, 3))
    polygons: list[list[int]] = []
    strips: list[list[int]] = []
    for element in elements:
        if element.name == "vertex":
            vertices = _xyz(element, rows.table(element))
        elif element.name in {"face", "tristrips"}:
            wanted = polygons if element.name == "face" else strips
            column = _corners(element)
            wanted += [[int(number) for number in row[column]] for row in rows.rows(element)]
        elif element.has_lists:
            for _ in rows.rows(element):
                pass
        else:
            rows.table(element)
    if rows.rest():
        raise MeshError("holds more than its header declares: it is damaged; export it again")
    points = vertices.tolist()
    yield part(
        points, (face for corners in polygons if corners for face in triangles(corners, points))
    )
    for numbers in strips:
        for is_end, piece in groupby(numbers, lambda number: number == END_OF_STRIP):
            if not is_end:
                yield Part(vertices, strip(np.array(list(piece), dtype=np.int64)))


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    end = END.search(data)
    begin = data[: end.start()].removeprefix(codecs.BOM_UTF8) if end else b""
    if begin[:3] != b"ply" or end is None:
        raise MeshError("does not begin like PLY: it is damaged, or of another format")
    lines = [line.split() for line in begin.decode(errors="replace").splitlines()]
    order, elements = None, list[_Element]()
    for words in filter(None, lines[1:]):
        match words:
            case ["format", name, _] if name in ORDERS:
                order = ORDERS[name]
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count)))
            case ["property", "list", length, kind, name] if elements and {length, kind} <= {
                *KINDS
            }:
                elements[-1].properties.append((name, KINDS[kind], KINDS[length]))
            case ["property", kind, name] if elements and kind in KINDS:
                elements[-1].properties.append((name, KINDS[kind], ""))
            case ["comment" | "obj_info", *_]:
                pass
            case _:
                raise MeshError(f"{' '.join(words)[:40]!r} in its header is unknown")
    if order is None:
        raise MeshError("its header has no format")
    return order, elements, data[end.end() :]


def _xyz(element: _Element, table: Array) -> Array:
    names = [name for name, _, _ in element.properties]
    missing = [axis for axis in "xyz" if axis not in names]
    if missing or element.has_lists:
        raise MeshError(f"its vertices have no {', '.join(missing) or 'fixed size'}")
    return table[:, [names.index(axis) for axis in "xyz"]]


def _corners(element: _Element) -> int:
    """Index of the property with a face's corners."""
    lists = [i for i, (_, _, length) in enumerate(element.properties) if length]
    named = [i for i in lists if element.properties[i][0] in CORNERS]
    if not (named or len(lists) == 1):
        raise MeshError(f"its element {element.name} has no vertex_indices")
    return (named or lists)[0]


def _cut_short(element: _Element, read: int | None = None) -> MeshError:
    held = "" if read is None else f" and holds {read}"
    return MeshError(
        f"declares {element.count} of {element.name}{held}: it is cut short; export it again"
    )


class _Words:
    """Reads values as text."""

    def __init__(self, body: bytes) -> None:
        self._words = body.split()
        self._at = 0

    def rest(self) -> bool:
        return self._at < len(self._words)

    def table(self, element: _Element) -> Array:
        """Values of an element without lists; (count, properties)."""
        size = element.count * len(element.properties)
        words = self._take(size)
        if len(words) < size:
            raise _cut_short(element)
        return np.array([float(word) for word in words]).reshape(element.count, -1)

    def rows(self, element: _Element) -> Iterator[Row]:
        for number in range(element.count if element.properties else 0):
            row = [self._values(length) for _, _, length in element.properties]
            if any(values is None for values in row):
                raise _cut_short(element, number)
            yield [[float(word) for word in values or ()] for values in row]

    def _values(self, length: str) -> Sequence[bytes] | None:
        count = 1
        if length:
            declared = self._take(1)
            if not declared:
                return None
            count = int(declared[0])
        words = self._take(count)
        return words if len(words) == count else None

    def _take(self, count: int) -> Sequence[bytes]:
        words = self._words[self._at : self._at + count]
        self._at += len(words)
        return words


class _Bytes:
    """Reads binary values."""

    def __init__(self, body: bytes, order: str) -> None:
        self._body = body
        self._order = order
        self._at = 0

    def rest(self) -> bool:
        return bool(self._body[self._at :].strip(b"\r\n\0"))

    def table(self, element: _Element) -> Array:
        """Values of an element without lists; (count, properties)."""
        kinds = [self._order + kind for _, kind, _ in element.properties]
        dtype = np.dtype([(str(i), kind) for i, kind in enumerate(kinds)])
        table = self._array(dtype, element)
        return np.column_stack([table[name].astype(float) for name in dtype.names or ()])

    def rows(self, element: _Element) -> Iterator[Row]:
        """Rows of an element; fast if all lists have the first one's length, the usual case."""
        if not element.properties:
            return
        begin = self._at
        for number in range(element.count):
            row = self._row(element, number)
            if number == 0 and (alike := self._alike(element, row, begin)) is not None:
                yield from alike
                return
            yield row

    def _alike(self, element: _Element, first: Row, begin: int) -> Iterator[Row] | None:
        fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
        for i, (_, kind, length) in enumerate(element.properties):
            if length:
                fields.append((f"length {i}", self._order + length))
            fields.append((f"{i}", self._order + kind, (len(first[i]),)))
        dtype = np.dtype(fields)
        if begin + element.count * dtype.itemsize > len(self._body):
            return None
        table = np.frombuffer(self._body, dtype, element.count, begin)
        if any(
            length and (table[f"length {i}"] != len(first[i])).any()
            for i, (_, _, length) in enumerate(element.properties)
        ):
            return None
        self._at = begin + table.nbytes
        columns = [
            table[f"{i}"].reshape(element.count, -1).tolist()
            for i in range(len(element.properties))
        ]
        return (list(row) for row in zip(*columns, strict=True))

    def _row(self, element: _Element, number: int) -> Row:
        row: Row = []
        try:
            for _, kind, length in element.properties:
                count = 1
                if length:
                    (declared,) = self._unpack(length, 1)
                    count = int(declared)
                row.append(list(self._unpack(kind, count)))
        except struct.error as error:
            raise _cut_short(element, number) from error
        return row

    def _unpack(self, kind: str, count: int) -> tuple[float, ...]:
        form = f"{self._order}{count}{kind}"
        values = struct.unpack_from(form, self._body, self._at)
        self._at += struct.calcsize(form)
        return values

    def _array(
        self, dtype: np.dtype[np.void], element: _Element
    ) -> np.ndarray[tuple[int, ...], np.dtype[np.void]]:
        held = (len(self._body) - self._at) // max(dtype.itemsize, 1)
        if held < element.count:
            raise _cut_short(element, held)
        table = np.frombuffer(self._body, dtype, element.count, self._at)
        self._at += table.nbytes
        return table
