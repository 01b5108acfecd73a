"""Tests that a coloured ROS map is read with map_server's thresholds."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from PIL import Image

from sitl.world.format import World
from sitl.world.loading import load_world

FREE, UNKNOWN, WALL = 254, 205, 0
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
SIZE = 60, 80


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("maps")


def painted(folder: Path, picture: Image.Image, name: str = "house.png") -> World:
    picture.save(folder / name)
    record = {
        "image": name,
        "resolution": 0.1,
        "origin": [0, 0, 0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESH,
        "free_thresh": FREE_THRESH,
    }
    (folder / "house.yaml").write_text(yaml.safe_dump(record))
    return load_world(str(folder / "house.yaml"))


def house(colour: tuple[int, ...], kind: str = "RGB") -> Image.Image:
    """A room with a partition of this colour."""
    rows, columns = SIZE
    shape = (*SIZE, len(colour)) if len(colour) > 1 else SIZE
    cells = np.full(shape, FREE, np.uint8)
    cells[:2] = cells[-2:] = cells[:, :2] = cells[:, -2:] = WALL
    if len(colour) in {2, 4}:
        cells[..., -1] = 255
    cells[12 : rows - 12, columns // 2 - 1 : columns // 2 + 1] = (
        colour if len(colour) > 1 else colour[0]
    )
    return Image.fromarray(cells, kind) if kind else Image.fromarray(cells)


def same(world: World, other: World) -> bool:
    return (world.walls, world.starts) == (other.walls, other.starts)


def shade(colour: tuple[int, ...]) -> int:
    """A grey value that map_server assigns the same state as the colour."""
    occupied = 1 - sum(colour) / len(colour) / 255
    return WALL if occupied > OCCUPIED_THRESH else FREE if occupied < FREE_THRESH else UNKNOWN


@example((0, 200, 0))
@example((255, 255, 0))
@example((200, 0, 0))
@example((0, 0, 255))
@given(st.tuples(*[st.integers(0, 255)] * 3))
def test_a_colour_is_classified_by_the_mean_of_its_channels(
    folder: Path, colour: tuple[int, int, int]
) -> None:
    grey = house((shade(colour),), "L")
    assert same(painted(folder, house(colour)), painted(folder, grey))


@pytest.mark.parametrize("colour", [(0, 200, 0), (255, 255, 0), (60, 60, 60)])
def test_palette_and_opaque_images_give_the_same_world(
    folder: Path, colour: tuple[int, int, int]
) -> None:
    expected = painted(folder, house((shade(colour),), "L"))
    few = house(colour).quantize(8)
    clear = house(colour).quantize(8)
    clear.info["transparency"] = bytes([255] * 8)
    for picture in (few, clear, house((*colour, 255), "RGBA")):
        assert same(painted(folder, picture), expected), picture.mode
    assert same(painted(folder, house(colour), "house.ppm"), expected)


@pytest.mark.parametrize("alpha", [0, 128, 254])
def test_transparent_pixels_are_unknown(folder: Path, alpha: int) -> None:
    expected = painted(folder, house((UNKNOWN,), "L"))
    assert same(painted(folder, house((0, 0, 0, alpha), "RGBA")), expected)
    assert same(painted(folder, house((0, alpha), "LA")), expected)
    palette = house((9, 9, 9)).convert("P", palette=Image.Palette.ADAPTIVE)
    clear = palette.getpixel((SIZE[1] // 2, SIZE[0] // 2))
    palette.save(folder / "marked.png", transparency=clear)
    assert same(painted(folder, Image.open(folder / "marked.png")), expected)


def test_only_the_upper_8_of_16_bits_are_used(folder: Path) -> None:
    wide = Image.fromarray(np.asarray(house((90,), "L")).astype(np.uint16) * 256 + 255)
    expected = painted(folder, house((shade((90,)),), "L"))
    assert same(painted(folder, wide), expected)
    assert same(painted(folder, wide, "house.pgm"), expected)
