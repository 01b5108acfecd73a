"""Tests that mesh files are read completely or rejected with a remedy."""

import base64
import codecs
import json
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
from numpy.typing import NDArray

from sitl.world.format import World, WorldError
from sitl.world.importers.formats.obj import read_obj
from sitl.world.importers.formats.polygons import triangles
from sitl.world.loading import load_world
from sitl.world.plan import wall_surfaces

Array = NDArray[Any]
Wall = tuple[float, float, float, float]
"""A wall from (x, y) to (x, y), m; x is east, y is north."""

OUTER: list[Wall] = [(0, 0, 8, 0), (8, 0, 8, 5), (8, 5, 0, 5), (0, 5, 0, 0)]
PARTITIONS: list[Wall] = [(4, 0, 4, 3), (4, 3, 6, 3)]
ROOM = OUTER + PARTITIONS
HEIGHT_M = 2.6
LENGTH_M = sum(math.dist(wall[:2], wall[2:]) for wall in ROOM)


def corners(wall: Wall) -> list[tuple[float, float, float]]:
    xa, ya, xb, yb = wall
    return [(xa, ya, 0), (xb, yb, 0), (xb, yb, HEIGHT_M), (xa, ya, HEIGHT_M)]


def plan(world: World) -> list[tuple[float, ...]]:
    """Sorted ends of all wall surfaces at a height of 1.2 m."""
    return sorted(
        tuple(round(float(x), 2) + 0.0 for end in sorted(line) for x in end)
        for line in wall_surfaces(world, 1.2)
    )


def length_m(world: World) -> float:
    return sum(math.dist(*line) for line in wall_surfaces(world, 1.2))


def refusal(path: Path) -> str:
    with pytest.raises(WorldError) as refused:
        load_world(str(path))
    assert "\n" not in str(refused.value)
    assert path.name in str(refused.value)
    return str(refused.value)


# OBJ


def obj(groups: Sequence[Sequence[Wall]], *, back: bool, slashes: str = "") -> str:
    """OBJ text: each group's vertices, then its faces, with relative indices if `back`."""
    lines, seen = [], 0
    for group in groups:
        lines += [f"v {x} {y} {z}" for wall in group for x, y, z in corners(wall)]
        seen += 4 * len(group)
        for number in range(len(group)):
            first = 4 * number - 4 * len(group) if back else seen + 4 * number - 4 * len(group) + 1
            lines.append("f " + " ".join(f"{first + i}{slashes}" for i in range(4)))
    return "\n".join(lines) + "\n"


ABSOLUTE = obj([ROOM], back=False)


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
    u, v = np.linalg.qr(np.array([[random.gauss(0, 1) for _ in range(2)] for _ in range(3)]))[0].T
    points = [tuple((x * u + y * v).tolist()) for x, y in flat]
    area = sum(a * d - b * c for (a, b), (c, d) in zip(flat, [*flat[1:], flat[0]], strict=True)) / 2
    cut = [np.array([points[i] for i in three]) for three in triangles(range(count), points)]
    assert len(cut) == count - 2
    areas = [np.linalg.norm(np.cross(b - a, c - a)) / 2 for a, b, c in cut]
    assert sum(areas) == pytest.approx(abs(area))


# glTF


class Gltf:
    """A glTF file built by hand."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": []}],
            **{key: [] for key in ("nodes", "meshes", "accessors", "bufferViews")},
        }
        self.blob = b""

    def view(self, data: bytes, **more: Any) -> int:
        record = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **more}
        self.blob += data + b"\0" * (-len(data) % 4)
        self.document["bufferViews"].append(record)
        return len(self.document["bufferViews"]) - 1

    def accessor(self, values: Array, kind: int, **more: Any) -> int:
        """Add an accessor of (n, width) values in their binary form."""
        names = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
        record = {"componentType": kind, "count": len(values), "type": names[values.shape[1]]}
        self.document["accessors"].append(
            {**record, "bufferView": self.view(values.tobytes()), **more}
        )
        return len(self.document["accessors"]) - 1

    def node(self, primitive: dict[str, Any], **more: Any) -> None:
        self.document["meshes"].append({"primitives": [primitive]})
        self.document["nodes"].append({"mesh": len(self.document["meshes"]) - 1, **more})
        self.document["scenes"][0]["nodes"].append(len(self.document["nodes"]) - 1)

    def wall(self, wall: Wall, **more: Any) -> None:
        at = self.accessor(y_up(wall).astype("<f4"), 5126)
        indices = self.accessor(np.array([[0, 1, 2, 0, 2, 3]], "<u2").T, 5123)
        self.node({"attributes": {"POSITION": at}, "indices": indices}, **more)

    def needs(self, *extensions: str) -> None:
        self.document["extensionsUsed"] = self.document["extensionsRequired"] = list(extensions)

    def save(self, path: Path) -> Path:
        length = {"byteLength": len(self.blob)}
        if path.suffix == ".gltf":
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.blob).decode()
            self.document["buffers"] = [{**length, "uri": uri}]
            path.write_text(json.dumps(self.document), encoding="utf-8-sig")
            return path
        self.document["buffers"] = [length]
        text = json.dumps(self.document).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I", len(text)) + b"JSON" + text
        chunks += struct.pack("<I", len(self.blob)) + b"BIN\0" + self.blob
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
        return path


def y_up(wall: Wall) -> Array:
    return np.array([(x, z, -y) for x, y, z in corners(wall)])


def gltf(walls: Sequence[Wall] = ROOM) -> Gltf:
    made = Gltf()
    for wall in walls:
        made.wall(wall)
    return made


@pytest.fixture
def truth(tmp_path: Path) -> list[tuple[float, ...]]:
    path = tmp_path / "truth.obj"
    path.write_text(ABSOLUTE)
    return plan(load_world(str(path)))


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_gltf_gives_the_same_room(
    tmp_path: Path, truth: list[tuple[float, ...]], suffix: str
) -> None:
    assert plan(load_world(str(gltf().save(tmp_path / f"room{suffix}")))) == truth


@pytest.mark.parametrize(("kind", "code"), [("i1", 5120), ("u1", 5121), ("i2", 5122), ("u2", 5123)])
def test_gltf_normalised_integers_are_scaled_by_their_maximum(
    tmp_path: Path, truth: list[tuple[float, ...]], kind: str, code: int
) -> None:
    most = np.iinfo(kind).max
    made = Gltf()
    for wall in ROOM:
        share = y_up(wall) / 10 + (0 if kind[0] == "i" else np.array([0, 0, 1.0]))
        padded = np.column_stack([np.round(share * most), np.zeros(4)]).astype(f"<{kind}")
        at = made.accessor(padded[:, :3], code, normalized=True)
        made.document["bufferViews"][-1] = {
            **made.document["bufferViews"][made.view(padded.tobytes())],
            "byteStride": padded.itemsize * 4,
        }
        made.document["accessors"][at]["bufferView"] = len(made.document["bufferViews"]) - 1
        indices = made.accessor(np.array([[0, 1, 2, 0, 2, 3]], "<u1").T, 5121)
        back = [0, 0, 0] if kind[0] == "i" else [0, 0, -10]
        place = {"scale": [10, 10, 10], "translation": back}
        made.node({"attributes": {"POSITION": at}, "indices": indices}, **place)
    made.needs("KHR_mesh_quantization")
    world = load_world(str(made.save(tmp_path / "room.glb")))
    found = np.array(plan(world))
    assert found.shape == np.array(truth).shape
    assert length_m(world) == pytest.approx(LENGTH_M, abs=0.3 if most < 300 else 0.01)


def test_gltf_instances_are_placed_by_their_transforms(tmp_path: Path) -> None:
    """One partition appears at each instance, rotated and scaled, and nowhere else."""
    made = gltf(OUTER)
    half = math.sqrt(0.5)
    attributes = {
        "TRANSLATION": made.accessor(np.array([(2, 0, 0), (4, 0, 0), (8, 0, -4)], "<f4"), 5126),
        "ROTATION": made.accessor(
            np.array([(0, 0, 0, 1), (0, 0, 0, 1), (0, half, 0, half)], "<f4"), 5126
        ),
        "SCALE": made.accessor(np.array([(1, 1, 1), (1, 1, 1.5), (1, 1, 0.5)], "<f4"), 5126),
    }
    made.wall((0, 0, 0, 2), extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    made.needs("EXT_mesh_gpu_instancing")
    walls = [*OUTER, (2, 0, 2, 2), (4, 0, 4, 3), (8, 4, 7, 4)]
    path = tmp_path / "same.obj"
    path.write_text(obj([walls], back=False))
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == plan(load_world(str(path)))


def test_gltf_sparse_values_replace_the_base_values(
    tmp_path: Path, truth: list[tuple[float, ...]]
) -> None:
    made = gltf(ROOM[:-1])
    wrong, right = y_up(ROOM[-1]), y_up(ROOM[-1])
    wrong[[1, 2]] = 99
    at = made.accessor(wrong.astype("<f4"), 5126)
    made.document["accessors"][at]["sparse"] = {
        "count": 2,
        "indices": {
            "bufferView": made.view(np.array([1, 2], "<u2").tobytes()),
            "componentType": 5123,
        },
        "values": {"bufferView": made.view(right[[1, 2]].astype("<f4").tobytes())},
    }
    indices = made.accessor(np.array([[0, 1, 2, 0, 2, 3]], "<u2").T, 5123)
    made.node({"attributes": {"POSITION": at}, "indices": indices})
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == truth


@pytest.mark.parametrize(("mode", "order"), [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])])
def test_gltf_strips_and_fans_are_triangulated(
    tmp_path: Path, truth: list[tuple[float, ...]], mode: int, order: list[int]
) -> None:
    made = Gltf()
    for wall in ROOM:
        at = made.accessor(y_up(wall)[order].astype("<f4"), 5126)
        made.node({"attributes": {"POSITION": at}, "mode": mode})
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == truth


@pytest.mark.parametrize(
    ("extension", "remedy"),
    [
        ("KHR_draco_mesh_compression", "Compression"),
        ("EXT_meshopt_compression", "gltfpack"),
        ("KHR_meshopt_compression", "gltfpack"),
        ("EXT_of_the_future", "export it without"),
    ],
)
def test_gltf_extensions_that_change_triangles_are_refused_by_name(
    tmp_path: Path, extension: str, remedy: str
) -> None:
    made = gltf()
    made.needs("KHR_mesh_quantization", extension)
    reports = refusal(made.save(tmp_path / "room.glb"))
    assert extension in reports
    assert remedy in reports


@pytest.mark.parametrize(
    "extension",
    ["KHR_texture_transform", "KHR_texture_basisu", "EXT_texture_webp", "KHR_materials_unlit"],
)
def test_gltf_extensions_that_only_change_colours_are_ignored(
    tmp_path: Path, truth: list[tuple[float, ...]], extension: str
) -> None:
    made = gltf()
    made.needs(extension)
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == truth


def test_gltf_with_one_compressed_wall_is_refused(tmp_path: Path) -> None:
    """The file does not list the extension as required."""
    made = gltf()
    primitive = made.document["meshes"][-1]["primitives"][0]
    del made.document["accessors"][primitive["attributes"]["POSITION"]]["bufferView"]
    packed = {"bufferView": made.view(b"DRACO"), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": packed}
    assert "KHR_draco_mesh_compression" in refusal(made.save(tmp_path / "room.glb"))


def test_gltf_hidden_nodes_and_other_scenes_are_ignored(
    tmp_path: Path, truth: list[tuple[float, ...]]
) -> None:
    made = gltf()
    made.wall((2, 0, 2, 2), extensions={"KHR_node_visibility": {"visible": False}})
    made.wall((1, 0, 1, 2))
    made.document["scenes"] += [{"nodes": [made.document["scenes"][0]["nodes"].pop()]}]
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == truth


@pytest.mark.parametrize("cut", [1, 30, 100])
def test_a_truncated_gltf_file_is_refused(tmp_path: Path, cut: int) -> None:
    path = gltf().save(tmp_path / "room.glb")
    path.write_bytes(path.read_bytes()[:-cut])
    assert "cut short" in refusal(path)


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
