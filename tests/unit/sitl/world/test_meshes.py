"""Tests of buildings imported from meshes, and of damaged files of every format."""

import io
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from trimesh.visual import TextureVisuals

from companion.core.arrays import Array
from companion.core.frames import Vector3
from sitl.world.format import World, WorldError
from sitl.world.geometry.model import WorldModel
from sitl.world.loading import load_world
from sitl.world.plan import wall_surfaces
from tests.examples import examples
from tests.unit.sitl.world.room_files import MAP, SQUARE, refused

BOX = trimesh.creation.box((5.0, 4.0, 2.6))
BOX.apply_translation((3.5, 3.0, 1.3))
TURNED_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
SUFFIXES = (".stl", ".obj", ".ply", ".glb", ".gltf")
SAME_ROOM = World.model_validate(
    {
        "name": "room",
        "height_m": 2.6,
        "walls": [{"points": [(1, 1), (5, 1), (5, 6), (1, 6)], "closed": True}],
        "starts": [{"name": "middle", "position": (3, 3.5)}],
    }
)


def write_mesh(
    folder: Path, suffix: str, what: trimesh.Trimesh | trimesh.Scene = BOX, name: str = "room"
) -> Path:
    """Write a z-up mesh in the format's own axes."""
    path = folder / f"{name}{suffix}"
    for beside, data in exported(what, suffix).items():
        (path if beside == "" else folder / beside).write_bytes(data)
    return path


def exported(what: trimesh.Trimesh | trimesh.Scene, suffix: str) -> dict[str, bytes]:
    """Content of the files by name; the main file's name is empty."""
    what = what.copy()
    if suffix in {".glb", ".gltf"}:
        what.apply_transform(TURNED_Y_UP)
    data = what.export(file_type=suffix[1:])
    if isinstance(data, dict):
        return {("" if name == "model.gltf" else name): part for name, part in data.items()}
    return {"": data.encode() if isinstance(data, str) else data}


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".STL"])
def test_a_room_is_the_same_in_every_format(tmp_path: Path, suffix: str) -> None:
    path = write_mesh(tmp_path, suffix.lower()).rename(tmp_path / f"room{suffix}")
    reports: list[str] = []
    world = load_world(str(path), reports.append)
    assert reports == []
    assert world.height_m == pytest.approx(2.6)
    assert world.bounds[0] + world.bounds[1] == pytest.approx((1, 1, 5, 6))
    model, truth = WorldModel(world), WorldModel(SAME_ROOM)
    random = np.random.default_rng(1)
    for _ in range(200):
        origin: Vector3 = tuple(random.uniform((1.1, 1.1, -2.5), (4.9, 5.9, -0.1)).tolist())
        way = random.normal(size=3)
        direction: Vector3 = tuple((way / np.linalg.norm(way)).tolist())
        expected = truth.range_m(origin, direction, 10)
        assert expected is not None
        assert model.range_m(origin, direction, 10) == pytest.approx(expected, abs=1e-5)


def test_wall_surfaces_are_a_section_through_the_mesh(tmp_path: Path) -> None:
    world = load_world(str(write_mesh(tmp_path, ".ply", BOX.subdivide().subdivide())))
    surfaces = wall_surfaces(world, 1.2)
    assert len(surfaces) == 4
    assert sum(math.dist(*surface) for surface in surfaces) == pytest.approx(18)


def test_scene_nodes_are_transformed_and_textures_ignored(tmp_path: Path) -> None:
    post = trimesh.creation.box((0.2, 0.2, 2.6))
    picture = Image.fromarray(SQUARE).convert("RGB")
    uv = np.zeros((8, 2))
    post.visual = TextureVisuals(uv=uv, image=picture)
    scene = trimesh.Scene()
    scene.add_geometry(BOX)
    for x in (2.0, 3.0):
        place = np.eye(4)
        place[:3, 3] = x, 2.0, 1.3
        scene.add_geometry(post, transform=place)
    world = load_world(str(write_mesh(tmp_path, ".glb", scene)))
    assert world.mesh is not None
    assert len(world.mesh.faces) == 3 * 12
    model = WorldModel(world)
    assert model.range_m((3.0, 2.0, -1.2), (-1.0, 0.0, 0.0), 5) == pytest.approx(0.9)
    assert model.range_m((3.0, 3.0, -1.2), (-1.0, 0.0, 0.0), 5) == pytest.approx(0.9)
    assert model.range_m((3.0, 2.5, -1.2), (-1.0, 0.0, 0.0), 5) == pytest.approx(2.0)


def test_the_floor_is_at_the_lowest_point_or_on_its_slab(tmp_path: Path) -> None:
    low = BOX.copy()
    low.apply_translation((0, 0, -7))
    world = load_world(str(write_mesh(tmp_path, ".stl", low)))
    assert WorldModel(world).range_m((3, 3, -1.2), (0, 0, 1), 5) == pytest.approx(1.2, abs=1e-5)
    shell = trimesh.creation.box((5.4, 4.4, 2.9))
    shell.apply_translation((3.5, 3.0, 1.3))
    reports: list[str] = []
    world = load_world(str(write_mesh(tmp_path, ".obj", shell + BOX)), reports.append)
    assert reports == ["floor set 0.15 m above the lowest point, on its slab"]
    assert world.height_m == pytest.approx(2.75)
    model = WorldModel(world)
    assert model.range_m((3, 3, -1.2), (0, 0, 1), 5) == pytest.approx(1.2)
    assert model.clearance_m((3, 3, 0)) > 0.5


def test_no_start_is_under_a_table(tmp_path: Path) -> None:
    table = trimesh.creation.box((2.0, 2.0, 0.02))
    table.apply_translation((3.5, 3.0, 0.75))
    world = load_world(str(write_mesh(tmp_path, ".stl", BOX + table)))
    for start in world.starts:
        north, east = start.position
        assert max(abs(north - 3), abs(east - 3.5)) > 1


def binary_ply(vertices: Array, faces: Array) -> bytes:
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.zeros(len(faces), dtype=[("n", "u1"), ("corners", "<i4", 3)])
    rows["n"], rows["corners"] = 3, faces
    return head.encode() + vertices.astype("<f4").tobytes() + rows.tobytes()


def test_unusable_triangles_are_left_out_and_reported(tmp_path: Path) -> None:
    vertices = np.vstack([BOX.vertices, [(math.nan, 0, 0), (2, 2, math.inf)]])
    bad = [(0, 1, 8), (0, 2, 9), (0, 0, 1), (1, 2, 900), (1, -5, 2), BOX.faces[3][::-1]]
    path = tmp_path / "room.ply"
    path.write_bytes(binary_ply(vertices, np.vstack([BOX.faces, bad])))
    reports: list[str] = []
    world = load_world(str(path), reports.append)
    assert reports == [
        "left out 2 of 18 triangles: corners that do not exist",
        "left out 2 of 16 triangles: not finite",
        "left out 1 of 16 triangles: without area",
        "left out 1 of 16 triangles: repeated",
    ]
    assert world.mesh is not None
    assert len(world.mesh.faces) == 12
    WorldModel(world)


def test_meshes_that_are_not_buildings_are_refused(tmp_path: Path) -> None:
    assert "if these are millimetres, scale it by 0.001; if centimetres, by 0.01" in refused(
        write_mesh(tmp_path, ".stl", BOX.copy().apply_scale(1000))
    )
    assert "0.026 m high" in refused(write_mesh(tmp_path, ".stl", BOX.copy().apply_scale(0.01)))
    far = BOX.copy().apply_translation((5e5, 4e6, 0))
    assert "from its origin" in refused(write_mesh(tmp_path, ".ply", far))
    flat = trimesh.creation.box((5, 4, 0.8))
    assert "nothing stands at 1.2 m" in refused(write_mesh(tmp_path, ".glb", flat))
    path = tmp_path / "room.ply"
    path.write_bytes(binary_ply(np.full((3, 3), math.nan), np.array([[0, 1, 2]])))
    assert "none of 1 triangles is usable" in refused(path)
    path.write_bytes(binary_ply(np.zeros((3, 3)), np.zeros((500_001, 3))))
    assert "500001 triangles" in refused(path)
    assert "No such file" in refused(tmp_path / "absent.obj")
    (tmp_path / "folder.glb").mkdir()
    assert "folder.glb" in refused(tmp_path / "folder.glb")


# Damaged files


def picture_bytes() -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(SQUARE).save(buffer, "PPM")
    return buffer.getvalue()


WHOLE = {
    **{f"room{suffix}": exported(BOX, suffix) for suffix in SUFFIXES},
    "house.yaml": {"": yaml.safe_dump(MAP).encode(), "house.pgm": picture_bytes()},
}
EVIL = [
    b"nan",
    b"inf",
    b"-1",
    b"99999999",
    b"1e308",
    b"\xff\xff\xff\xff",
    b"\x00\x00\xc0\x7f",
    b"[",
]


@st.composite
def damaged(draw: st.DrawFn, whole: bytes) -> bytes:
    """The file with some bytes changed, inserted or removed; or random bytes."""
    if draw(st.integers(0, 9)) == 0:
        return draw(st.binary(max_size=200))
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 5))):
        at = draw(st.integers(0, len(data)))
        piece = draw(st.sampled_from(EVIL) | st.binary(min_size=1, max_size=4))
        data[at : at + draw(st.integers(0, 8))] = piece
    return bytes(data[: draw(st.integers(0, len(data)))] if draw(st.integers(0, 5)) == 0 else data)


@settings(max_examples=examples(150))
@given(st.data())
def test_a_damaged_file_is_refused_or_gives_a_valid_world(
    folder: Path, data: st.DataObject
) -> None:
    name = data.draw(st.sampled_from(sorted(WHOLE)))
    files = {beside or name: content for beside, content in WHOLE[name].items()}
    victim = data.draw(st.sampled_from(sorted(files)))
    files[victim] = data.draw(damaged(files[victim]))
    for beside, content in files.items():
        (folder / beside).write_bytes(content)
    try:
        world = load_world(str(folder / name))
    except WorldError:
        return
    north, east = world.starts[0].position
    assert WorldModel(world).range_m((north, east, -1.2), (0.0, 0.0, 1.0), 5) is not None
