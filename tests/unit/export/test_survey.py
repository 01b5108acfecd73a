"""Tests the survey of a map: rooms, doors, openings and areas."""

import math
from pathlib import Path

import ezdxf.filemanagement
import ezdxf.path
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import Place
from companion.core.messages import FloorPlan, Pose, WallSegment
from companion.export.formats import export
from companion.export.plan.labels import Labels
from companion.export.plan.survey import survey
from sitl.world.loading import load_world
from sitl.world.plan import wall_surfaces


def true_plan(name: str, way_ne_m: list[tuple[float, float]]) -> FloorPlan:
    """A map of the true walls, with a path flown back and forth."""
    walls = (WallSegment(*ends, 0.01, 100) for ends in wall_surfaces(load_world(name), 1.2))
    way = way_ne_m + way_ne_m[::-1] + way_ne_m
    return FloorPlan(
        tuple(walls), (), tuple(Pose(i, n, e, -1.2, 0) for i, (n, e) in enumerate(way))
    )


@pytest.mark.parametrize(
    ("name", "way_ne_m", "areas_m2", "doors_m"),
    [
        ("room_100", [(2, 2), (8, 8)], [100], []),
        ("room_200", [(2, 2), (8, 18)], [200], []),
        ("room_300", [(2, 2), (8, 18)], [300], []),
        ("two_room_300", [(5, 4), (7.5, 7), (7.5, 13), (3, 17)], [149.25, 149.25], [1.2]),
        (
            "three_room_450",
            [(6, 4), (4, 8), (4, 12), (11, 18), (11, 22), (5, 25)],
            [149.25, 149.25, 148.5],
            [1.2, 1.2],
        ),
        ("unusual", [(4, 3.5), (7.5, 11)], [108.1], []),
        ("office", [(3, 5), (5, 7), (5, 11), (7, 13)], [88.6, 68.4], [1.0]),
    ],
)
def test_the_survey_finds_rooms_and_doors_of_the_papers_buildings(
    name: str, way_ne_m: list[tuple[float, float]], areas_m2: list[float], doors_m: list[float]
) -> None:
    found = survey(true_plan(name, way_ne_m))
    assert [room.area_m2 for room in found.rooms] == pytest.approx(areas_m2, rel=0.02)
    assert [gap.width_m for gap in found.openings] == pytest.approx(doors_m, abs=0.02)


def walled(ends: list[tuple[tuple[float, float], tuple[float, float]]]) -> tuple[WallSegment, ...]:
    return tuple(WallSegment(*a_and_b, 0.01, 100) for a_and_b in ends)


BEHIND_A_CUPBOARD = walled(
    [
        *[((0, 0), (0, 6)), ((0, 6), (8, 6)), ((8, 6), (8, 0))],
        *[((8, 0), (5, 0)), ((5, 0.4), (2.5, 0.4)), ((2.5, 0), (0, 0))],
    ]
)


@pytest.mark.parametrize(("ways_out", "rooms_m2"), [(0, [48]), (3, [])])
def test_a_gap_behind_a_cupboard_is_closed_unless_the_path_crosses_it(
    ways_out: int, rooms_m2: list[float]
) -> None:
    way = [(2, 3), (4, 3)] + ways_out * [(4, -2), (4, 3)]
    path = tuple(Pose(i, n, e, -1.2, 0) for i, (n, e) in enumerate(way))
    found = survey(FloorPlan(BEHIND_A_CUPBOARD, (), path))
    assert [room.area_m2 for room in found.rooms] == pytest.approx(rooms_m2)
    assert not found.openings


def test_the_inside_of_a_wall_with_an_open_end_is_not_part_of_a_room() -> None:
    """The partition is 14 cm thick; one face ends 3 cm before the outer wall; hits lie inside."""
    outer = [((0, 0), (0, 5)), ((0, 5), (9, 5)), ((9, 5), (9, 0)), ((9, 0), (0, 0))]
    south = [((4.4, 0.03), (4.4, 2)), ((4.4, 3), (4.4, 4.97))]
    north = [((4.54, 0), (4.54, 2.01)), ((4.54, 2.99), (4.54, 5))]
    way = [(2, 1), (4.47, 1), (2, 1), (2, 2.5), (7, 2.5), (2, 2.5), (2, 4), (4.47, 4)]
    path = tuple(Pose(i, n, e, -1.2, 0) for i, (n, e) in enumerate(way))
    rooms = survey(FloorPlan(walled([*outer, *south, *north]), (), path)).rooms
    assert [room.area_m2 for room in rooms] == pytest.approx([22.3, 22.0], abs=0.15)


def test_an_opening_is_a_gap_in_the_walls_of_the_glb_and_a_block_in_the_dxf(tmp_path: Path) -> None:
    found = survey(true_plan("two_room_300", [(5, 4), (7.5, 7), (7.5, 13), (3, 17)]))
    glb, dxf = export(
        found, ["glb", "dxf"], tmp_path, "map", Labels("a plan", Place(47.4, 8.5, 0.0))
    )
    (opening,) = found.openings
    panel = trimesh.load_scene(glb).geometry["openings"]
    east_m, height_m, south_m = panel.extents
    assert height_m == pytest.approx(found.height_m)
    assert math.hypot(east_m, south_m) == pytest.approx(opening.width_m)
    walls = trimesh.load_scene(glb).geometry["walls"]
    assert len(walls.ray.intersects_location([[9.0, 1.0, -7.5]], [[1.0, 0.0, 0.0]])[0]) == 1
    space = ezdxf.filemanagement.readfile(dxf).modelspace()
    (block,) = space.query('INSERT[layer=="OPENINGS"]')
    assert block.dxf.xscale == pytest.approx(opening.width_m)


def test_a_room_that_neither_beams_nor_the_path_entered_is_not_a_room() -> None:
    found = survey(true_plan("two_room_300", [(5, 4), (7, 5)]))
    assert [room.area_m2 for room in found.rooms] == pytest.approx([149.25], rel=0.02)
    assert not found.openings


@given(
    st.floats(2, 30), st.floats(2, 30), st.floats(0, 0.4), st.floats(-math.pi, math.pi), st.data()
)
def test_a_room_with_gaps_in_its_corners_is_closed(
    north_m: float, east_m: float, gap_m: float, turn_rad: float, data: st.DataObject
) -> None:
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)

    def turned(north: float, east: float) -> tuple[float, float]:
        return north * cos - east * sin, north * sin + east * cos

    n, e, g = north_m, east_m, gap_m
    ends = [
        ((0, g), (0, e - g)),
        ((g, e), (n - g, e)),
        ((n, e - g), (n, g)),
        ((n - g, 0), (g, 0)),
    ]
    walls = [WallSegment(turned(*a), turned(*b), 0.01, 9) for a, b in ends]
    walls = data.draw(st.permutations(walls))
    path = tuple(Pose(i, *turned(n / 2, e * (i + 1) / 4), -1.2, 0) for i in range(3))
    (room,) = survey(FloorPlan(tuple(walls), (), path)).rooms
    assert room.area_m2 == pytest.approx(n * e, rel=1e-3)
