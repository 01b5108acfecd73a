"""Tests that OBJ, STL and PLY files are read completely or rejected with a remedy."""

import codecs
import math
import struct
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.world.importers.formats.obj import read_obj
from sitl.world.importers.formats.polygons import triangles
from sitl.world.loading import load_world
from tests.unit.sitl.world.room_files import (
    ABSOLUTE,
    LENGTH_M,
    OUTER,
    PARTITIONS,
    ROOM,
    Wall,
    corners,
    length_m,
    obj,
    plan,
    refusal,
)

# OBJ


@given(data=st.data())
def test_obj_faces_with_relative_indices_equal_those_with_absolute_indices(
    data: st.DataObject,
) -> None:
    cuts = sorted(data.draw(st.sets(st.integers(1, len(ROOM) - 1))))
    ends = [0, *cuts, len(ROOM)]
    groups = [ROOM[a:b] for a, b in pairwise(ends)]
    slashes = data.draw(st.sampled_from(["", "/1", "//-1", "/1/1"]))
    (counted_on,) = read_obj(ABSOLUTE.encode(), Path())
    (read,) = read_obj(obj(groups, back=True, slashes=slashes).encode(), Path())
    assert (read.vertices[read.faces] == counted_on.vertices[counted_on.faces]).all()


@pytest.mark.parametrize("groups", [[ROOM], [OUTER, PARTITIONS], [[wall] for wall in ROOM]])
def test_obj_walls_with_relative_indices_are_complete(
    tmp_path: Path, groups: list[list[Wall]]
) -> None:
    path = tmp_path / "room.obj"
    path.write_text(obj(groups, back=True))
    reports: list[str] = []
    world = load_world(str(path), reports.append)
    assert reports == []
    assert world.mesh is not None
    assert len(world.mesh.faces) == 12
    assert length_m(world) == pytest.approx(LENGTH_M)


def test_obj_syntax_variants_are_read(tmp_path: Path) -> None:
    """Continued lines, comments after statements, Windows line ends, vertices after faces."""
    text = "# Küche\r\n" + ABSOLUTE.replace("\n", "  # wall\r\n").replace("f 1 2", "f 1 \\\r\n 2")
    (tmp_path / "room.obj").write_bytes(text.encode("cp1252"))
    assert length_m(load_world(str(tmp_path / "room.obj"))) == pytest.approx(LENGTH_M)
    faces_first = sorted(ABSOLUTE.splitlines(), key=lambda line: line[0])
    (tmp_path / "room.obj").write_text("\n".join(faces_first))
    assert length_m(load_world(str(tmp_path / "room.obj"))) == pytest.approx(LENGTH_M)


@pytest.mark.parametrize("name", ["# exported from C:\\models\\", "mtllib C:\\", "g wall\\ "])
@pytest.mark.parametrize("statement", ["v", "f"])
def test_obj_comments_and_names_may_end_with_a_backslash(
    tmp_path: Path, name: str, statement: str
) -> None:
    """The statement below is not part of the name. A lost vertex would shift all others."""
    (tmp_path / "room.obj").write_text(
        ABSOLUTE.replace(f"{statement} ", f"{name}\n{statement} ", 1)
    )
    assert length_m(load_world(str(tmp_path / "room.obj"))) == pytest.approx(LENGTH_M)


def test_obj_errors_name_the_line_on_which_a_continued_statement_begins(tmp_path: Path) -> None:
    path = tmp_path / "room.obj"
    path.write_text(ABSOLUTE.replace("f 1 2", "f 1 \\ \n 2") + "f 1 \\\n 2 x\n")
    assert "line 32: 'f 1   2 x'" in refusal(path)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_obj_with_a_byte_order_mark_is_read(tmp_path: Path, encoding: str) -> None:
    """The first vertex follows the byte order mark. If it were lost, all indices would shift."""
    (tmp_path / "room.obj").write_text(ABSOLUTE, encoding=encoding)
    assert length_m(load_world(str(tmp_path / "room.obj"))) == pytest.approx(LENGTH_M)


def test_obj_faces_with_missing_vertices_are_reported(tmp_path: Path) -> None:
    path = tmp_path / "room.obj"
    path.write_text(ABSOLUTE + "f 1 2 900\nf 1 2 -900\nf 0 1 2\n")
    reports: list[str] = []
    load_world(str(path), reports.append)
    assert reports == ["left out 3 of 15 triangles: corners that do not exist"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("f 1 2 x", ("line 31", "'f 1 2 x'")),
        ("v 1 2", ("line 31", "'v 1 2'")),
        ("surf 0 1 0 1 1 2 3", ("line 31", "free-form", "export triangles")),
        ("call other.obj", ("line 31", "other files")),
    ],
)
def test_unreadable_obj_lines_are_reported_by_number(
    tmp_path: Path, line: str, words: tuple[str, ...]
) -> None:
    path = tmp_path / "room.obj"
    path.write_text(f"{ABSOLUTE}{line}\n")
    assert all(word in refusal(path) for word in words)


def test_a_doorway_in_a_wall_of_one_polygon_stays_open(tmp_path: Path) -> None:
    """A wall with a doorway is a concave polygon. A triangle fan would close the doorway."""
    face = [
        (4, y, z) for y, z in ((0, 0), (2, 0), (2, 2), (3, 2), (3, 0), (5, 0), (5, 2.6), (0, 2.6))
    ]
    for turn in range(len(face)):
        ring = face[turn:] + face[:turn]
        lines = [f"v {x} {y} {z}" for x, y, z in ring] + ["f -8 -7 -6 -5 -4 -3 -2 -1"]
        (tmp_path / "room.obj").write_text(obj([OUTER], back=False) + "\n".join(lines))
        world = load_world(str(tmp_path / "room.obj"))
        assert length_m(world) == pytest.approx(26 + 4), turn


@given(st.integers(4, 12), st.randoms(use_true_random=False))
def test_triangulation_preserves_the_area_of_a_polygon(count: int, random: Any) -> None:
    """Star-shaped polygons in any plane, from any corner."""
    angles = sorted(random.uniform(0, math.tau) for _ in range(count))
    gaps = [b - a for a, b in zip(angles, [*angles[1:], angles[0] + math.tau], strict=True)]
    if max(gaps) > 3 or min(gaps) < 0.05:
        return
    flat = [(r * math.cos(a), r * math.sin(a)) for a in angles for r in [random.uniform(0.5, 3)]]
    u, v = np.linalg.qr(np.array([[random.uniform(-1, 1) for _ in range(2)] for _ in range(3)]))[
        0
    ].T
    points = [tuple((x * u + y * v).tolist()) for x, y in flat]
    area = sum(a * d - b * c for (a, b), (c, d) in zip(flat, [*flat[1:], flat[0]], strict=True)) / 2
    cut = [np.array([points[i] for i in three]) for three in triangles(range(count), points)]
    assert len(cut) == count - 2
    areas = [np.linalg.norm(np.cross(b - a, c - a)) / 2 for a, b, c in cut]
    assert sum(areas) == pytest.approx(abs(area))


# STL and PLY


def stl() -> bytes:
    facets = [np.array(corners(wall))[three] for wall in ROOM for three in ([0, 1, 2], [0, 2, 3])]
    rows = b"".join(bytes(12) + facet.astype("<f4").tobytes() + bytes(2) for facet in facets)
    return bytes(80) + struct.pack("<I", len(facets)) + rows


def stl_text(name: str = "room") -> str:
    lines = [f"solid {name}"]
    for wall in ROOM:
        for three in ([0, 1, 2], [0, 2, 3]):
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += ["vertex {} {} {}".format(*corners(wall)[i]) for i in three]
            lines += ["endloop", "endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""])


def test_stl_gives_the_same_room(tmp_path: Path, truth: list[tuple[float, ...]]) -> None:
    path = tmp_path / "room.stl"
    for data in (
        stl(),
        stl_text().encode(),
        stl_text().encode("utf-8-sig"),
        stl_text("a vertex 1 2 3 facet").upper().encode(),
        stl_text().replace("\n", "\r\n").encode(),
        stl_text().replace("\n", "\r").encode(),
        stl() + b"\r\n",
    ):
        path.write_bytes(data)
        assert plan(load_world(str(path))) == truth


def test_stl_with_a_wrong_triangle_count_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "room.stl"
    for data in (stl()[:-50], stl()[:-7], stl() + bytes(50), b"solid" + stl()[5:-50]):
        path.write_bytes(data)
        assert "declares 12 triangles and holds" in refusal(path)
    lines = stl_text().splitlines()
    path.write_text("\n".join(lines[:-8]))
    assert "without endsolid" in refusal(path)
    path.write_text("\n".join(lines[:4] + lines[5:]))
    assert "35 corners for 12 facets" in refusal(path)


def ply(form: str, polygons: Sequence[Sequence[int]], *, more: str = "") -> bytes:
    vertices = [corner for wall in ROOM for corner in corners(wall)]
    head = (
        f"ply\nformat {form} 1.0\ncomment by hand\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\nproperty uchar red\n"
        f"element face {len(polygons)}\nproperty uchar flags\n"
        f"property list uchar int vertex_indices\n{more}end_header\n"
    ).encode()
    if form == "ascii":
        rows = [f"{x} {y} {z} 255" for x, y, z in vertices]
        rows += [f"7 {len(face)} {' '.join(map(str, face))}" for face in polygons]
        return head + "\n".join(rows).encode() + b"\n"
    order = "<" if "little" in form else ">"
    body = b"".join(struct.pack(f"{order}fffB", *corner, 255) for corner in vertices)
    body += b"".join(
        struct.pack(f"{order}BB{len(face)}i", 7, len(face), *face) for face in polygons
    )
    return head + body


FORMS = ["ascii", "binary_little_endian", "binary_big_endian"]
QUADS = [[4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3] for i in range(len(ROOM))]
MIXED = [*QUADS[:2], *([a, b, c] for q in QUADS[2:] for a, b, c in (q[:3], [q[0], *q[2:]]))]
LONG = [[*QUADS[0][:2], QUADS[0][1], *QUADS[0][2:]], *QUADS[1:]]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("polygons", [QUADS, MIXED, LONG])
def test_ply_gives_the_same_room(
    tmp_path: Path, truth: list[tuple[float, ...]], form: str, polygons: list[list[int]]
) -> None:
    path = tmp_path / "room.ply"
    path.write_bytes(ply(form, polygons))
    assert plan(load_world(str(path))) == truth
    path.write_bytes(codecs.BOM_UTF8 + ply(form, polygons).replace(b"\n", b"\r\n", 9))
    assert plan(load_world(str(path))) == truth


def test_a_ply_comment_may_mention_the_end_of_the_header(
    tmp_path: Path, truth: list[tuple[float, ...]]
) -> None:
    path = tmp_path / "room.ply"
    path.write_bytes(ply("ascii", QUADS).replace(b"by hand", b"before end_header\ncomment"))
    assert plan(load_world(str(path))) == truth


def test_a_ply_property_of_an_unknown_type_is_named(tmp_path: Path) -> None:
    path = tmp_path / "room.ply"
    path.write_bytes(ply("ascii", QUADS).replace(b"uchar red", b"half red"))
    assert "'property half red' in its header is unknown" in refusal(path)


@pytest.mark.parametrize("form", FORMS)
def test_ply_with_less_or_more_data_than_declared_is_refused(tmp_path: Path, form: str) -> None:
    path = tmp_path / "room.ply"
    for polygons in (QUADS, MIXED):
        whole = ply(form, polygons)
        path.write_bytes(whole.rstrip()[:-12])
        assert f"declares {len(polygons)} of face and holds" in refusal(path)
        path.write_bytes(whole + b"4 4 4 4 4 4")
        assert "more than its header declares" in refusal(path)


def test_ply_strips_are_triangulated(tmp_path: Path, truth: list[tuple[float, ...]]) -> None:
    numbers = [n for a, b, c, d in QUADS for n in (a, b, d, c, -1)]
    text = ply("ascii", [], more="element tristrips 1\nproperty list int int vertex_indices\n")
    path = tmp_path / "room.ply"
    path.write_bytes(text + f"{len(numbers)} {' '.join(map(str, numbers))}\n".encode())
    assert plan(load_world(str(path))) == truth
