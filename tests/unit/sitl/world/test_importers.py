"""Tests of imported ROS maps and meshes: accuracy, repairs and rejections."""

import io
import json
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.path import Path as Outline
from numpy.typing import NDArray
from PIL import Image
from trimesh.visual import TextureVisuals

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector3
from sitl.world.format import Segment, World, WorldError
from sitl.world.geometry.model import WorldModel
from sitl.world.geometry.polylines import legs
from sitl.world.loading import load_world
from sitl.world.plan import samples, wall_surfaces

CELL_M = 0.05
WALL_M = 0.15
FREE, UNKNOWN, WALL = 254, 205, 0
Picture = NDArray[np.uint8]

MAP = {
    "image": "house.pgm",
    "resolution": CELL_M,
    "origin": [0.0, 0.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all hypothesis examples share; each example overwrites its files."""
    return tmp_path_factory.mktemp("importers")


def write_map(folder: Path, picture: Image.Image, **changes: object) -> str:
    record = {**MAP, **changes}
    picture.save(folder / str(record["image"]))
    path = folder / "house.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in record.items() if v is not None}))
    return str(path)


def distance_m(points: Array, segments: list[Segment]) -> Array:
    """Distance of each point to the nearest segment."""
    walls = np.array(segments, dtype=float)
    start, along = walls[:, 0], walls[:, 1] - walls[:, 0]
    share = ((points[:, None] - start) * along).sum(axis=2) / (along**2).sum(axis=1)
    foot = start + np.clip(share, 0, 1)[..., None] * along
    nearest: Array = np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)
    return nearest


def sides(corners: Array) -> list[Segment]:
    return legs(np.concatenate([corners, corners[:1]]))


def outside(corners: Array) -> Array:
    """Corners of the walls' outer face; the room has right angles and anticlockwise corners."""
    along = np.roll(corners, -1, axis=0) - corners
    out = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    outer: Array = corners + WALL_M * (out + np.roll(out, 1, axis=0))
    return outer


def is_within(corners: Array, shape: tuple[int, int]) -> Mask:
    """Mask of the cells whose centre is in the polygon (x, y); rows from the top."""
    y, x = (np.indices(shape) + 0.5) * CELL_M
    inside = Outline(corners).contains_points(np.column_stack([x.ravel(), y.ravel()]))
    return np.flipud(inside.reshape(shape))


def rasterise(corners: Array) -> Picture:
    """A map of a room with these corners (x, y) and walls; the lower left cell is at (0, 0)."""
    columns, rows = np.ceil((corners.max(axis=0) + 1) / CELL_M).astype(int).tolist()
    wall, room = (is_within(c, (rows, columns)) for c in (outside(corners), corners))
    return np.where(room, FREE, np.where(wall, WALL, UNKNOWN)).astype(np.uint8)


def turned(corners: Array, angle_rad: float) -> Array:
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    moved = corners @ np.array([[cos, sin], [-sin, cos]])
    to_one: Array = moved - moved.min(axis=0) + 1
    return to_one


@st.composite
def rooms(draw: st.DrawFn) -> Array:
    """Corners (x, y) of rectangles and L-shapes."""
    width, depth = draw(st.floats(3, 6)), draw(st.floats(3, 6))
    if draw(st.booleans()):
        return np.array([(0, 0), (width, 0), (width, depth), (0, depth)])
    arm, leg = draw(st.floats(1.5, width - 1)), draw(st.floats(1.5, depth - 1))
    return np.array([(0, 0), (width, 0), (width, leg), (arm, leg), (arm, depth), (0, depth)])


@settings(max_examples=25)
@given(rooms(), st.just(0.0) | st.floats(0, math.tau))
def test_imported_walls_are_complete_and_accurate_to_about_a_cell(
    folder: Path, corners: Array, angle_rad: float
) -> None:
    corners = turned(corners, angle_rad)
    world = load_world(write_map(folder, Image.fromarray(rasterise(corners))))
    found = wall_surfaces(world, 1.2)
    truth = sides(corners[:, ::-1]) + sides(outside(corners)[:, ::-1])
    # the cells of a slanted wall have an error of up to 0.7 of a cell
    within_m = 0.51 * CELL_M if angle_rad == 0 else 1.5 * CELL_M
    assert distance_m(samples(found), truth).max() <= within_m
    assert distance_m(samples(truth), found).max() <= within_m
    assert len(found) <= 3 * len(truth)


@settings(max_examples=25)
@given(st.floats(0, math.pi), st.floats(0.1, 0.6))
def test_a_slanted_wall_is_imported_without_stair_steps(
    folder: Path, angle_rad: float, thickness_m: float
) -> None:
    bar = turned(np.array([(0, 0), (6, 0), (6, thickness_m), (0, thickness_m)]), angle_rad)
    shades = np.full((200, 200), FREE, dtype=np.uint8)
    shades[is_within(bar, (200, 200))] = WALL
    shades[[0, -1]] = shades[:, [0, -1]] = WALL
    world = load_world(write_map(folder, Image.fromarray(shades)))
    assert len(world.walls) <= 8 + 12


SQUARE = rasterise(np.array([(1.0, 1.0), (5.0, 1.0), (5.0, 4.0), (1.0, 4.0)]))


def test_x_is_east_and_y_is_north(tmp_path: Path) -> None:
    world = load_world(write_map(tmp_path, Image.fromarray(SQUARE), origin=[10, 20, 0]))
    (south, west), (north, east) = world.bounds
    assert (south, north) == pytest.approx((20 + 1 - WALL_M, 20 + 4 + WALL_M), abs=CELL_M)
    assert (west, east) == pytest.approx((10 + 1 - WALL_M, 10 + 5 + WALL_M), abs=CELL_M)


@settings(max_examples=10)
@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-math.pi, math.pi))
def test_the_origin_rotates_and_translates_the_map(
    folder: Path, x_m: float, y_m: float, yaw_rad: float
) -> None:
    picture = Image.fromarray(SQUARE)
    plain = load_world(write_map(folder, picture))
    moved = load_world(write_map(folder, picture, origin=[x_m, y_m, yaw_rad]))
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    for before, after in zip(plain.walls, moved.walls, strict=True):
        for (north, east), found in zip(before.points, after.points, strict=True):
            expected = y_m + sin * east + cos * north, x_m + cos * east - sin * north
            assert found == pytest.approx(expected, abs=1e-5)


def two_rooms(second: int) -> Picture:
    """Two rooms side by side; the cells of the eastern one have this value."""
    shades = np.full((80, 160), FREE, dtype=np.uint8)
    shades[:, 80:] = second
    shades[[0, -1]] = shades[:, [0, 79, 80, -1]] = WALL
    return shades


def test_starts_are_in_free_cells(tmp_path: Path) -> None:
    both = load_world(write_map(tmp_path, Image.fromarray(two_rooms(FREE))))
    one = load_world(write_map(tmp_path, Image.fromarray(two_rooms(UNKNOWN))))
    assert {start.position[1] > 4 for start in both.starts} == {True, False}
    assert {start.position[1] > 4 for start in one.starts} == {False}
    model = WorldModel(one)
    assert all(model.clearance_m((*start.position, -1.2)) >= 0.6 for start in one.starts)


def test_image_formats_and_modes_give_the_same_world(tmp_path: Path) -> None:
    expected = load_world(write_map(tmp_path, Image.fromarray(SQUARE)))
    shades = Image.fromarray(SQUARE)
    percent = np.select([SQUARE == FREE, SQUARE == WALL], [0, 100], 255).astype(np.uint8)
    see_through = Image.fromarray(np.where(SQUARE == UNKNOWN, 0, 255).astype(np.uint8))
    dark = Image.fromarray(np.where(SQUARE == WALL, 0, 255).astype(np.uint8))
    marked = Image.merge("LA", (dark, see_through))
    for picture, changes in (
        (shades, {"image": "house.png"}),
        (shades.convert("RGB"), {"image": "house.png", "mode": "scale"}),
        (shades.convert("P"), {"image": "house.png"}),
        (Image.fromarray(SQUARE.astype(np.uint16) * 257), {"image": "house.png"}),
        (Image.fromarray(255 - SQUARE), {"negate": 1}),
        (Image.fromarray(percent), {"mode": "raw"}),
        (marked, {"image": "house.png", "mode": "scale"}),
    ):
        found = load_world(write_map(tmp_path, picture, **changes))
        assert (found.walls, found.starts) == (expected.walls, expected.starts), changes


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"resolution": -1}, "house.yaml: resolution = -1: should be greater than 0"),
        ({"resolution": math.nan}, "resolution"),
        ({"resolution": None}, "resolution: Field required"),
        ({"resolution": 0x10**6000}, "resolution = a huge number"),
        ({"origin": [0, 0]}, "origin"),
        ({"origin": [5000, 0, 0]}, "origin"),
        ({"origin": [999, 0, 0]}, "reaches 1004 m"),
        ({"negate": "perhaps"}, "negate = 'perhaps'"),
        ({"occupied_thresh": 65}, "occupied_thresh = 65"),
        ({"occupied_thresh": 0.1}, "free_thresh should not be above"),
        ({"mode": "colour"}, "mode = 'colour'"),
        ({"occupied_tresh": 0.65}, "occupied_tresh"),
        ({"negate": 1, "free_thresh": 0.0}, "no enclosed place"),
        ({"occupied_thresh": 1.0}, "no cell is a wall"),
    ],
)
def test_bad_maps_are_refused_in_one_line(
    tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    path = write_map(tmp_path, Image.fromarray(SQUARE))
    record = {k: v for k, v in {**MAP, **changes}.items() if v is not None}
    Path(path).write_text("\n".join(f"{k}: {_yaml(v)}" for k, v in record.items()))
    with pytest.raises(WorldError) as refused:
        load_world(path)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def _yaml(value: object) -> str:
    if isinstance(value, int) and value > 10**9:
        return hex(value)
    return ".nan" if isinstance(value, float) and math.isnan(value) else json.dumps(value)


def refused(path: Path | str) -> str:
    with pytest.raises(WorldError) as error:
        load_world(str(path))
    message = str(error.value)
    assert "\n" not in message
    return message


def test_damaged_images_are_refused(tmp_path: Path) -> None:
    path = write_map(tmp_path, Image.fromarray(SQUARE))
    picture = tmp_path / "house.pgm"
    good = picture.read_bytes()
    for data in (good[:-500], good[:9], b"", b"P5\n-4 4\n255\n", b"P5 4 4 9\n1234", bytes(400)):
        picture.write_bytes(data)
        assert "image = house.pgm" in refused(path)
    picture.write_bytes(b"P5\n9000 10\n255\n")
    assert "9000 × 10 cells are too many" in refused(path)
    picture.write_bytes(b"P5\n90000 90000\n255\n")
    assert "image = house.pgm" in refused(path)
    picture.unlink()
    assert "No such file" in refused(path)


def test_a_noise_image_is_refused(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    for size in (400, 1000):
        noise = random.integers(0, 2, (size, size)).astype(np.uint8) * 255
        assert "separate walls" in refused(write_map(tmp_path, Image.fromarray(noise)))


@pytest.mark.parametrize("text", ["", "7", "[", "a: &a [*a]", "!!int ''", "!!timestamp x", "\0"])
def test_invalid_yaml_maps_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "house.yaml"
    path.write_text(text)
    assert "house.yaml" in refused(path)


# Meshes

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
    assert "if these are millimetres" in refused(
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


# Garbage


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


@settings(max_examples=150)
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
