"""Tests of worlds: their files, and exact ranges and clearances."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import Vector3
from sitl.world.format import World, WorldError
from sitl.world.geometry.mesh import obstacle_mesh, visible_mesh
from sitl.world.geometry.model import BODY_RADIUS_M, WorldModel
from sitl.world.loading import load_world, world_names
from sitl.world.plan import observable_points, wall_surfaces
from tests.examples import examples

FURNISHED = World.model_validate(
    {
        "name": "furnished",
        "height_m": 2.6,
        "walls": [
            {"points": [(0, 0), (6, 0), (6, 5), (0, 5)], "closed": True},
            {"points": [(2, 0), (2.5, 2)], "top_m": 1.8},
        ],
        "boxes": [
            {"corner": (4, 3), "size": (0.8, 1.2), "top_m": 0.75},
            {"corner": (1, 4), "size": (0.4, 0.4), "bottom_m": 1.0, "top_m": 2.0},
        ],
        "starts": [{"name": "middle", "position": (3, 2.5)}],
    }
)
MODEL = WorldModel(FURNISHED)
REACH_M = 12.0


def true_range(origin: Vector3, direction: Vector3) -> float | None:
    """Range by brute force: the plane of every triangle, and an area test."""
    mesh = visible_mesh(FURNISHED)
    to_floor = -origin[2] / direction[2] if direction[2] > 0 else None
    best = to_floor if to_floor is not None and to_floor <= REACH_M else None
    start, along = np.array(origin), np.array(direction)
    for a, b, c in mesh.vertices[mesh.faces]:
        normal = np.cross(b - a, c - a)
        slope = float(normal @ along)
        if abs(slope) < 1e-12:
            continue
        distance = float(normal @ (a - start)) / slope
        hit = start + distance * along
        parts = [np.cross(q - p, hit - p) @ normal for p, q in ((a, b), (b, c), (c, a))]
        inside = min(parts) >= -1e-9 * float(normal @ normal)
        if inside and 0 <= distance <= REACH_M and (best is None or distance < best):
            best = distance
    return best


INSIDE = st.tuples(st.floats(0.05, 5.95), st.floats(0.05, 4.95), st.floats(-2.55, -0.05))


def unit(bearing_rad: float, climb_rad: float) -> Vector3:
    level = math.cos(climb_rad)
    return level * math.cos(bearing_rad), level * math.sin(bearing_rad), -math.sin(climb_rad)


@settings(max_examples=examples(300))
@given(INSIDE, st.floats(-math.pi, math.pi), st.floats(-1.5, 1.5))
def test_ranges_are_exact(origin: Vector3, bearing_rad: float, climb_rad: float) -> None:
    direction = unit(bearing_rad, climb_rad)
    expected = true_range(origin, direction)
    assert expected is not None  # a closed room: every ray hits a wall
    assert MODEL.range_m(origin, direction, REACH_M) == pytest.approx(expected, abs=1e-9)


CORNERS = [(n, e, d) for n in (0.0, 6.0) for e in (0.0, 5.0) for d in (0.0, -1.3, -2.6)]


@settings(max_examples=examples(200))
@given(INSIDE, st.sampled_from(CORNERS))
def test_rays_at_edges_and_corners_are_not_lost(origin: Vector3, corner: Vector3) -> None:
    distance = math.dist(origin, corner)
    direction = tuple((c - o) / distance for c, o in zip(corner, origin, strict=True))
    expected = true_range(origin, direction)  # type: ignore[arg-type]
    found = MODEL.range_m(origin, direction, REACH_M)  # type: ignore[arg-type]
    assert found is not None
    assert expected is not None
    assert found == pytest.approx(expected, abs=1e-6)


def test_obstacles_beyond_the_maximum_range_are_not_detected() -> None:
    assert MODEL.range_m((3.0, 2.5, -1.2), (1.0, 0.0, 0.0), 2.9) is None
    assert MODEL.range_m((3.0, 2.5, -1.2), (1.0, 0.0, 0.0), 3.1) == pytest.approx(3.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_non_finite_poses_raise_value_error(bad: float) -> None:
    with pytest.raises(ValueError, match="not a finite pose"):
        MODEL.range_m((bad, 0.0, 0.0), (1.0, 0.0, 0.0), 5.0)
    with pytest.raises(ValueError, match="not a finite pose"):
        MODEL.clearance_m((bad, 0.0, 0.0))


@pytest.mark.parametrize(
    ("position", "clearance_m"),
    [
        ((5.5, 1.0, -1.3), 0.5),
        ((3.0, 2.5, -2.3), 0.3),
        ((4.4, 3.6, -1.75), 0.85),
        ((4.4, 3.6, -0.4), 0.0),
        ((1.2, 4.2, -1.5), 0.0),
    ],
)
def test_clearance_includes_walls_ceiling_and_solids(position: Vector3, clearance_m: float) -> None:
    assert MODEL.clearance_m(position) == pytest.approx(clearance_m, abs=1e-6)


def test_the_floor_is_no_obstacle() -> None:
    assert MODEL.clearance_m((3.0, 2.5, 0.0)) > 0.5


@settings(max_examples=examples(30))
@given(st.lists(INSIDE, min_size=2, max_size=20), st.floats(0, 2))
def test_body_clearance_is_exact_up_to_a_bound(path: list[Vector3], exact_to_m: float) -> None:
    watching = WorldModel(FURNISHED)
    for position in path:
        exact_m = watching.clearance_m(position) - BODY_RADIUS_M
        found_m = watching.body_clearance_m(position, exact_to_m)
        assert found_m <= exact_m + 1e-6
        assert found_m == pytest.approx(exact_m, abs=1e-6) or found_m > exact_to_m


def test_the_papers_first_room_is_ten_by_ten() -> None:
    room = load_world("room_100")
    surfaces = wall_surfaces(room, 1.2)
    assert sum(math.dist(*surface) for surface in surfaces) == 40
    assert room.height_m == 2.6
    model = WorldModel(room)
    start = (*room.starts[0].position, -1.2)
    assert model.clearance_m(start) > BODY_RADIUS_M + 1


@pytest.mark.parametrize("name", world_names())
def test_every_built_in_world_loads(name: str) -> None:
    world = load_world(name)
    assert world.name == name
    assert len(obstacle_mesh(world).faces)


@pytest.mark.parametrize("name", world_names())
def test_every_start_is_free(name: str) -> None:
    world = load_world(name)
    model = WorldModel(world)
    for start in world.starts:
        assert model.clearance_m((*start.position, -1.2)) >= 0.6


@pytest.mark.parametrize("name", ["two_room_300", "three_room_450", "complex", "office"])
def test_every_room_can_be_reached_from_every_start(name: str) -> None:
    world = load_world(name)
    seen = [len(observable_points(world, 1.2, start.position)) for start in world.starts]
    assert max(seen) - min(seen) <= 0.01 * max(seen)


def test_a_wall_observable_from_one_side_counts_once() -> None:
    """The building in `exterior` cannot be entered: its walls count from the yard only."""
    world = load_world("exterior")
    points = observable_points(world, 1.2, world.starts[0].position)
    around_yard = 2 * (24 + 28)
    around_building = 10 + 14 + 5 + 7 + 5 + 7
    assert len(points) * 0.05 == pytest.approx(around_yard + around_building, rel=0.01)


@pytest.mark.parametrize("away_m", [0.7, 3.0])
def test_outer_walls_are_observable_from_a_start_outside_a_closed_building(away_m: float) -> None:
    square = {"points": [(0, 0), (4, 0), (4, 4), (0, 4)], "closed": True}
    start = {"name": "garden", "position": (-away_m, 2)}
    world = World.model_validate(
        {"name": "hut", "height_m": 2.6, "walls": [square], "starts": [start]}
    )
    points = observable_points(world, 1.2, world.starts[0].position)
    assert len(points) * 0.05 == pytest.approx(16, rel=0.02)


DOOR = World.model_validate(
    {
        "name": "door",
        "height_m": 2.6,
        "walls": [
            {"points": [(0, 0), (4, 0), (4, 8), (0, 8)], "closed": True},
            {
                "points": [(0, 4), (4, 4)],
                "thickness_m": 0.2,
                "doors": [{"centre": (2, 4), "width_m": 1.0, "height_m": 2.0}],
            },
        ],
        "starts": [{"name": "west", "position": (2, 2)}],
    }
)


@pytest.mark.parametrize(("width_m", "beyond"), [(0.7, False), (0.9, True), (1.0, True)])
def test_space_behind_a_door_is_observable_only_if_a_drone_fits_through(
    width_m: float, beyond: bool
) -> None:
    door = DOOR.walls[1].doors[0].model_copy(update={"width_m": width_m})
    wall = DOOR.walls[1].model_copy(update={"doors": (door,)})
    world = DOOR.model_copy(update={"walls": (DOOR.walls[0], wall)})
    for north_m in (1.9, 1.95, 2.0, 2.05):
        points = observable_points(world, 1.2, (north_m, 2.0))
        assert (points[:, 1].max() > 7.9) == beyond


def test_a_door_is_open_below_its_lintel() -> None:
    model = WorldModel(DOOR)
    east = (0.0, 1.0, 0.0)
    assert model.range_m((2.0, 2.0, -1.2), east, 8) == pytest.approx(6.0)
    assert model.range_m((2.0, 2.0, -2.3), east, 8) == pytest.approx(1.9)
    assert model.range_m((1.0, 2.0, -1.2), east, 8) == pytest.approx(1.9)


def test_a_thick_wall_has_two_faces_and_ends() -> None:
    surfaces = wall_surfaces(DOOR, 1.2)
    assert len(surfaces) == 4 + 2 * 4
    assert len(wall_surfaces(DOOR, 2.3)) == 4 + 3 * 4


def test_furniture_has_surfaces_only_at_its_height() -> None:
    assert len(wall_surfaces(FURNISHED, 0.5)) == 4 + 1 + 4
    assert len(wall_surfaces(FURNISHED, 1.5)) == 4 + 1 + 4
    assert len(wall_surfaces(FURNISHED, 2.2)) == 4


STRAY_DOOR = "[[walls.doors]]\ncentre = [5, 5]\nwidth_m = 1\n"
WALLS = "[[walls]]\npoints = [[0, 0], [1, 0]]\n[[starts]]\nname = 'a'\nposition = [0.5, 0.5]\n"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("name = 'x'\nheight_m = nan\n" + WALLS, "height_m"),
        ("name = 'x'\nheight_m = 2.6\nroof = 1\n" + WALLS, "roof"),
        ("name = 'x'\nhight_m = 2.6\n" + WALLS, "hight_m = 2.6: no such key"),
        ("name = 'x'\nheight_m = 2.6\n" + WALLS.replace("[1, 0]", "[0, 0]"), "same point"),
        ("name = 'x'\nheight_m = 2.6\n" + WALLS.replace("[1, 0]", "[1e9, 0]"), "1000"),
        ("name = 'x'\nheight_m = 2.6\n" + WALLS.split("[[starts]]", maxsplit=1)[0], "starts"),
        ("name = 'x'\nheight_m = 2.6\n[[starts]]\nname = 'a'\nposition = [0, 0]\n", "walls"),
        (
            "name = 'x'\nheight_m = 2.6\n"
            + WALLS.replace(
                "[[starts]]", "[[walls.doors]]\ncentre = [5, 5]\nwidth_m = 1\n[[starts]]"
            ),
            "none of the walls",
        ),
        ("name = ", "not TOML"),
    ],
)
def test_bad_worlds_are_refused_in_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(WorldError) as refused:
        load_world(str(path))
    message = str(refused.value)
    assert "bad.toml" in message
    assert complaint in message
    assert "\n" not in message


def test_an_unknown_world_name_lists_the_known_names() -> None:
    with pytest.raises(WorldError, match="room_100"):
        load_world("kitchen")
