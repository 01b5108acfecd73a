"""Tests of imported ROS maps: accuracy, image formats and rejections."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from companion.core.arrays import Array
from sitl.world.format import Segment, WorldError
from sitl.world.geometry.model import WorldModel
from sitl.world.geometry.polylines import legs
from sitl.world.loading import load_world
from sitl.world.plan import samples, wall_surfaces
from tests.examples import examples
from tests.maps import CELL_M, FREE, UNKNOWN, WALL
from tests.unit.sitl.world.room_files import (
    MAP,
    SQUARE,
    WALL_M,
    Picture,
    is_within,
    outside,
    rasterise,
    refused,
    write_map,
)


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


@settings(max_examples=examples(25))
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


@settings(max_examples=examples(25))
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


def test_x_is_east_and_y_is_north(tmp_path: Path) -> None:
    world = load_world(write_map(tmp_path, Image.fromarray(SQUARE), origin=[10, 20, 0]))
    (south, west), (north, east) = world.bounds
    assert (south, north) == pytest.approx((20 + 1 - WALL_M, 20 + 4 + WALL_M), abs=CELL_M)
    assert (west, east) == pytest.approx((10 + 1 - WALL_M, 10 + 5 + WALL_M), abs=CELL_M)


@settings(max_examples=examples(10))
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


@pytest.mark.parametrize("form", ["JPEG", "BMP", "TIFF", "GIF"])
def test_images_of_other_formats_are_refused_with_the_remedy(tmp_path: Path, form: str) -> None:
    path = write_map(tmp_path, Image.fromarray(SQUARE))
    Image.fromarray(SQUARE).save(tmp_path / "house.pgm", form)
    said = "house.yaml: image = house.pgm: neither PGM nor PNG; save it as PNG"
    assert said in refused(path)


def test_an_image_of_fractions_is_not_read_as_black(tmp_path: Path) -> None:
    path = write_map(tmp_path, Image.fromarray(SQUARE))
    rows, columns = SQUARE.shape
    shares = np.flipud(SQUARE / 255).astype("<f4").tobytes()
    (tmp_path / "house.pgm").write_bytes(f"Pf\n{columns} {rows}\n-1.0\n".encode() + shares)
    assert "neither PGM nor PNG" in refused(path)


def test_a_key_that_occurs_twice_is_refused(tmp_path: Path) -> None:
    """Of two resolutions map_server takes the first, and the YAML parser the last."""
    path = Path(write_map(tmp_path, Image.fromarray(SQUARE)))
    path.write_text(path.read_text() + "\nresolution: 0.1\n")
    assert "the key 'resolution' occurs 2 times" in refused(str(path))


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
