"""Tests of worlds from incomplete maps: unknown cells are neither free nor wall."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from typer.testing import CliRunner

from companion.core.messages import FloorPlan, WallSegment
from sitl.commands.cli import commands as flying
from sitl.core.truth import TrueState
from sitl.scoring.score import MapScore, score_map
from sitl.world.cli import commands
from sitl.world.cropping import cropped
from sitl.world.format import Segment, World, WorldError
from sitl.world.geometry.model import WorldModel
from sitl.world.loading import load_world
from sitl.world.plan import observable_points, wall_surfaces
from tests.examples import examples
from tests.maps import CELL_M, FREE, UNKNOWN, WALL, Shades, cells, fill, nothing, room, write

HEIGHT_M = 1.2
FAR_M = 60.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all hypothesis examples share; each example overwrites its files."""
    return tmp_path_factory.mktemp("unknown")


def loaded(folder: Path, shades: Shades) -> tuple[World, list[str]]:
    """The loaded world and the reports of its import."""
    reports: list[str] = []
    return load_world(write(folder, shades), reports.append), reports


def range_m(world: World, place: tuple[float, float], bearing_deg: float) -> float | None:
    bearing_rad = math.radians(bearing_deg)
    ray = math.cos(bearing_rad), math.sin(bearing_rad), 0.0
    return WorldModel(world).range_m((*place, -HEIGHT_M), ray, FAR_M)


def border_m(world: World) -> float:
    assert world.known is not None
    return world.known.border_m


def window_room() -> Shades:
    """A room of 5 × 5 m; 2.5 m of its east wall gave no returns."""
    shades = nothing(8, 8)
    room(shades, 1, 1, 6, 6)
    fill(shades, 2, 6, 4.5, 6.1, UNKNOWN)
    return shades


def fan_room() -> Shades:
    """A room of 9 × 2.6 m, and the fan that beams swept through its east doorway, 1 m wide."""
    shades = nothing(12, 12)
    room(shades, 1, 1, 10, 3.6)
    fill(shades, 5, 3.6, 6, 3.7, FREE)
    for column in range(cells(3.7), cells(7.6)):
        half_m = 0.5 + 0.8 * (column * CELL_M - 3.7)
        fill(shades, 5.5 - half_m, column * CELL_M, 5.5 + half_m, (column + 1) * CELL_M, FREE)
    fill(shades, 1.9, 7.6, 9.1, 7.7, WALL)
    return shades


# The border to the unknown


def test_a_window_without_returns_is_closed(tmp_path: Path) -> None:
    world, _ = loaded(tmp_path, window_room())
    assert range_m(world, (3.0, 3.0), 90) == pytest.approx(3.0, abs=CELL_M)
    assert WorldModel(world).body_clearance_m((3.0, 5.9, -HEIGHT_M), 0.0) <= 0
    assert border_m(world) == pytest.approx(2.5, abs=0.01)


def test_a_closed_building_has_no_border_to_the_unknown(tmp_path: Path) -> None:
    shades = nothing(8, 8)
    room(shades, 1, 1, 6, 6)
    world, reports = loaded(tmp_path, shades)
    assert world.closed_border == ()
    assert reports == []
    assert world.known is not None
    assert world.known.unknown_share == 0
    assert world.known.free_m2 == pytest.approx(25)
    assert world.known.reached_m2 == pytest.approx(25, abs=0.5)


def test_the_edge_of_the_map_image_is_a_border(tmp_path: Path) -> None:
    shades = nothing(8, 8)
    room(shades, 1, 1, 6, 6)
    world, _ = loaded(tmp_path, shades[:, : cells(5)])
    assert range_m(world, (3.0, 3.0), 90) == pytest.approx(2.0, abs=CELL_M)


@settings(max_examples=examples(15), deadline=None)
@given(
    st.floats(0, math.tau),
    st.lists(st.tuples(st.floats(0, 1), st.floats(0.05, 0.6)), min_size=1, max_size=5),
    st.integers(0, 2**32 - 1),
)
def test_no_beam_leaves_an_enclosed_room(
    folder: Path, angle_rad: float, openings: list[tuple[float, float]], seed: int
) -> None:
    """A square room, rotated, with pieces of its walls and some cells missing."""
    north, east = (np.indices((cells(9), cells(9))) + 0.5) * CELL_M - 4.5
    along = math.cos(angle_rad) * north + math.sin(angle_rad) * east
    across = math.cos(angle_rad) * east - math.sin(angle_rad) * north
    away = np.maximum(abs(along), abs(across))
    around = np.arctan2(across, along) / math.tau + 0.5
    shades = np.where(away < 2.5, FREE, np.where(away < 2.6, WALL, UNKNOWN)).astype(np.uint8)
    for at, width in openings:
        shades[(away >= 2.5) & (abs(around - at) < width / 8)] = UNKNOWN
    unseen = np.random.default_rng(seed).random(shades.shape) < 0.01
    shades[unseen & (away > 1) & (away < 2.5)] = UNKNOWN
    try:
        world, _ = loaded(folder, shades)
    except WorldError:  # too many cells are missing: no room is enclosed
        return
    model = WorldModel(world)
    place = world.starts[0].position
    for bearing_rad in np.arange(90) * math.tau / 90:
        ray = math.cos(bearing_rad), math.sin(bearing_rad)
        reach_m = model.range_m((*place, -HEIGHT_M), (*ray, 0.0), FAR_M)
        assert reach_m is not None
        end = np.add(place, np.multiply(reach_m, ray)) - 4.5
        assert np.hypot(*end) < 2.6 * math.sqrt(2) + 2 * CELL_M


@pytest.mark.parametrize("yaw_rad", [0.7, -2.0])
def test_the_border_rotates_with_the_map(tmp_path: Path, yaw_rad: float) -> None:
    plain = load_world(write(tmp_path, window_room()))
    turned = load_world(write(tmp_path, window_room(), yaw_rad))
    assert border_m(turned) == pytest.approx(border_m(plain), abs=1e-4)
    north, east = 3.0, 3.0
    place = (
        math.cos(yaw_rad) * north + math.sin(yaw_rad) * east,
        math.cos(yaw_rad) * east - math.sin(yaw_rad) * north,
    )
    expected = range_m(plain, (north, east), 90)
    assert range_m(turned, place, 90 - math.degrees(yaw_rad)) == pytest.approx(expected)


def test_narrow_unknown_gaps_stay_open_and_a_wide_unknown_patch_is_closed(tmp_path: Path) -> None:
    shades = nothing(9, 9)
    room(shades, 1, 1, 8, 8)
    for east_m in np.arange(1.5, 7.5, 0.5):
        fill(shades, 6.0, east_m, 6.2, east_m + 0.05, UNKNOWN)
    gaps, _ = loaded(tmp_path, shades)
    assert gaps.closed_border == ()
    assert range_m(gaps, (3.0, 3.03), 0) == pytest.approx(5.0)
    fill(shades, 5.0, 4.0, 5.5, 4.5, UNKNOWN)
    patch, _ = loaded(tmp_path, shades)
    assert 1.5 < border_m(patch) <= 2.0  # the corners of the patch are as narrow as gaps
    assert range_m(patch, (3.0, 4.25), 0) == pytest.approx(2.0, abs=CELL_M)
    for start in gaps.starts:
        away_m = math.hypot(max(6.0 - start.position[0], start.position[0] - 6.2, 0.0))
        assert away_m > 0.5


def test_the_border_cuts_off_narrow_free_strips(
    tmp_path: Path,
) -> None:
    shades = nothing(8, 14)
    room(shades, 1, 1, 6, 6)
    fill(shades, 2, 6, 4.5, 6.1, UNKNOWN)
    for north_m in (2.5, 3.0, 3.5, 4.0):
        fill(shades, north_m, 6, north_m + 0.2, 12, FREE)
    world, _ = loaded(tmp_path, shades)
    assert range_m(world, (3.1, 3.0), 90) == pytest.approx(3.0, abs=0.3)
    assert border_m(world) < 5


def test_a_cropped_world_keeps_its_border(tmp_path: Path) -> None:
    world, _ = loaded(tmp_path, window_room())
    piece = cropped(world, 7.0, 0)
    assert range_m(piece, (3.0, 3.0), 90) == pytest.approx(3.0, abs=CELL_M)
    small = cropped(world, 4.0, 0)
    assert small.closed_border == ()


# Starts


def test_no_start_is_in_a_fan_of_beams_behind_a_doorway(tmp_path: Path) -> None:
    world, reports = loaded(tmp_path, fan_room())
    assert all(1 < start.position[1] < 3.6 for start in world.starts)
    assert any("fan" in line and line.startswith("no start on") for line in reports)


def test_starts_are_only_in_the_largest_room(tmp_path: Path) -> None:
    shades = nothing(8, 14)
    room(shades, 1, 1, 3.4, 3.4)
    room(shades, 1, 4, 7, 12)
    world, reports = loaded(tmp_path, shades)
    assert all(start.position[1] > 4 for start in world.starts)
    assert any("no way leads there" in line for line in reports)


def test_a_map_without_an_enclosed_room_is_refused_with_the_reason(tmp_path: Path) -> None:
    shades = nothing(10, 10)
    fill(shades, 2, 2, 8, 8, FREE)
    fill(shades, 2, 8, 8, 8.1, WALL)
    with pytest.raises(WorldError, match="border on unknown cells") as refused:
        loaded(tmp_path, shades)
    assert "\n" not in str(refused.value)


def test_a_map_without_room_for_a_drone_is_refused_with_the_reason(tmp_path: Path) -> None:
    shades = nothing(4, 8)
    room(shades, 1, 1, 1.7, 6)
    with pytest.raises(WorldError, match="as wide as a door"):
        loaded(tmp_path, shades)
    fill(shades, 1, 1, 1.7, 6, UNKNOWN)
    with pytest.raises(WorldError, match="no cell is free"):
        loaded(tmp_path, shades)


# The score


def scored(world: World, walls: list[Segment]) -> MapScore:
    start = world.starts[0].position
    take_off = TrueState(0.0, (*start, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)

    def local(point: tuple[float, float]) -> tuple[float, float]:
        return point[0] - start[0], point[1] - start[1]

    plan = FloorPlan(tuple(WallSegment(local(a), local(b), 0.01, 10) for a, b in walls))
    observable = observable_points(world, HEIGHT_M, start)
    surfaces = wall_surfaces(world, HEIGHT_M)
    return score_map(plan, surfaces, observable, take_off, world.closed_border)


def test_a_wall_at_the_closed_border_is_neither_required_nor_false(tmp_path: Path) -> None:
    world, _ = loaded(tmp_path, window_room())
    seen: list[Segment] = [
        ((2.0, 6.0), (1.0, 6.0)),
        ((1.0, 6.0), (1.0, 1.0)),
        ((1.0, 1.0), (6.0, 1.0)),
        ((6.0, 1.0), (6.0, 6.0)),
        ((6.0, 6.0), (4.5, 6.0)),
    ]
    window: Segment = ((2.0, 6.0), (4.5, 6.0))
    for walls in (seen, [*seen, window]):
        score = scored(world, walls)
        assert score.coverage == pytest.approx(1.0, abs=0.01)
        assert score.false_walls == 0
        assert score.wall_error_cm == pytest.approx(0, abs=0.1)
    invented = scored(world, [*seen, window, ((3.0, 2.0), (3.0, 4.0))])
    assert invented.false_walls == pytest.approx(2 / (17.5 + 2), abs=0.01)
    assert scored(world, [window]).coverage < 0.03


def test_only_walls_in_sight_of_known_space_are_required(tmp_path: Path) -> None:
    """A wall behind the window is not required: the space before it is unknown."""
    shades = window_room()
    fill(shades, 2, 7, 4.5, 7.1, WALL)
    world, _ = loaded(tmp_path, shades)
    points = observable_points(world, HEIGHT_M, world.starts[0].position)
    assert points[:, 1].max() < 6.2


# Specks and labels


def test_labels_outside_the_building_are_left_out_and_reported(tmp_path: Path) -> None:
    for paper in (UNKNOWN, FREE):
        shades = np.full((cells(10), cells(10)), paper, dtype=np.uint8)
        room(shades, 1, 1, 6, 6)
        for east_m in (2.0, 2.6, 3.2):  # letters above the building
            fill(shades, 8.0, east_m, 8.6, east_m + 0.1, WALL)
            fill(shades, 8.0, east_m, 8.1, east_m + 0.4, WALL)
        world, reports = loaded(tmp_path, shades)
        assert world.bounds[1][0] == pytest.approx(6.1)
        assert any("left out 3 marks" in line for line in reports)


def test_walls_of_a_second_building_are_kept(tmp_path: Path) -> None:
    shades = nothing(8, 20)
    room(shades, 1, 1, 6, 6)
    room(shades, 1, 10, 6, 13)
    world, _ = loaded(tmp_path, shades)
    assert world.bounds[1][1] == pytest.approx(13.1)


def test_small_obstacles_are_kept_as_pillars_and_reported(tmp_path: Path) -> None:
    shades = nothing(8, 8)
    room(shades, 1, 1, 7, 7)
    for north_m, east_m in ((3.0, 3.0), (3.0, 3.4), (3.4, 3.0), (3.4, 3.4)):
        fill(shades, north_m, east_m, north_m + 0.05, east_m + 0.05, WALL)
    world, reports = loaded(tmp_path, shades)
    assert any("kept 4 specks" in line and "ceiling at 2.6 m" in line for line in reports)
    assert WorldModel(world).clearance_m((3.02, 2.5, -2.4)) == pytest.approx(0.2, abs=0.06)
    assert range_m(world, (3.02, 2.0), 90) == pytest.approx(1.0, abs=CELL_M)


# Output of the commands


def output_of(path: str, command: str = "check", *more: str) -> str:
    result = CliRunner().invoke(commands, [command, path, *more])
    if result.exception is not None:
        raise result.exception
    assert result.exit_code == 0
    return result.output


def test_check_reports_size_and_known_area(tmp_path: Path) -> None:
    shades = nothing(8, 9)
    room(shades, 1, 1, 6, 7)
    output = output_of(write(tmp_path, shades))
    assert "house: 5.2 × 6.2 m, 2.6 m high" in output
    assert "no heights" in output
    assert "known to be free: 30.0 m²" in output
    assert "unknown: 0%" in output
    assert "start 1: " in output
    assert output.rstrip().endswith("starts, good")
    assert "warning" not in output


def test_check_warns_if_over_half_of_the_building_is_unknown(tmp_path: Path) -> None:
    output = output_of(write(tmp_path, fan_room()))
    assert "border to the unknown closed: " in output
    assert "warning: " in output
    assert "of the reachable area is unknown" in output
    assert output.rstrip().endswith("see the warnings")


def test_fly_prints_the_same_warning_as_check(tmp_path: Path) -> None:
    mission = tmp_path / "short.toml"
    mission.write_text("[mission]\ntime_limit_s = 5\n")
    world = write(tmp_path, fan_room())
    flown = CliRunner().invoke(flying, ["fly", world, "--mission", str(mission)])
    assert flown.output.startswith("warning: ")
    assert "of the reachable area is unknown" in flown.output


def test_check_warns_if_little_of_the_free_area_is_reachable_from_the_start(tmp_path: Path) -> None:
    shades = nothing(8, 14)
    room(shades, 1, 1, 6, 5)
    room(shades, 1, 5.1, 6, 9)
    room(shades, 1, 9.1, 6, 13)
    output = output_of(write(tmp_path, shades))
    assert "warning: only 19.8 of 59.0 m² that are known to be free can be reached" in output


def test_check_of_a_built_in_world_reports_no_unknown_area() -> None:
    output = output_of("room_100")
    assert "room_100: 10 × 10 m, 2.6 m high" in output
    assert "unknown" not in output
    assert "good" in output


def shaded(path: Path) -> int:
    """Pixels of an image in the colour of the unknown."""
    pixels = np.asarray(Image.open(path).convert("RGB"))
    return int(np.count_nonzero((pixels == (0xD9, 0xD5, 0xCB)).all(axis=2)))


def test_show_shades_the_unknown_area(tmp_path: Path) -> None:
    picture = tmp_path / "plan.png"
    output_of("room_100", "show", "--out", str(picture))
    assert shaded(picture) == 0
    output_of(write(tmp_path, window_room()), "show", "--out", str(picture))
    assert shaded(picture) > 10_000
    output_of(write(tmp_path, window_room(), 0.5), "show", "--out", str(picture))
    assert shaded(picture) > 10_000
