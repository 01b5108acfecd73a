"""`sitl world --clean`: specks, dotted lines, curtains; what `check` tells of the space."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from sitl.world.checking import facts
from sitl.world.cleaning import SMOOTH_M, cleaned
from sitl.world.format import Start, Walls, World, WorldError
from sitl.world.loading import load_world
from sitl.world.plan import samples, wall_surfaces

ROOM = Walls(points=((0, 0), (4, 0), (4, 3), (0, 3)), closed=True)
DOOR = Walls.model_validate(
    {"points": [(2, 0), (2, 3)], "thickness_m": 0.1, "doors": [{"centre": (2, 1.5), "width_m": 1}]}
)


def world(*walls: Walls) -> World:
    return World(name="flat", height_m=2.6, walls=walls, starts=(Start(name="a", position=(1, 1)),))


def speck(north_m: float, east_m: float) -> Walls:
    half_m = 0.05
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    points = tuple((north_m + x * half_m, east_m + y * half_m) for x, y in corners)
    return Walls(points=points, closed=True)


def surfaces_m(found: World) -> list[float]:
    """Lengths of the wall surfaces."""
    return sorted(round(math.dist(*each), 2) for each in wall_surfaces(found, 1.2))


def test_specks_are_left_out_and_dotted_lines_are_joined() -> None:
    dots = [speck(3.0, 0.6 + 0.3 * number) for number in range(6)]
    said: list[str] = []
    found = cleaned(world(ROOM, *dots, speck(1, 2), speck(0.5, 2.5)), said.append)
    assert surfaces_m(found) == [1.5, 3.0, 3.0, 4.0, 4.0]
    assert said == [
        "left out 2 specks of up to 0.25 m",
        "joined 6 dots to 1 walls of 1.5 m in all",
    ]


def test_walls_with_doors_and_thickness_stay() -> None:
    before = world(ROOM, DOOR)
    assert surfaces_m(cleaned(before, print)) == surfaces_m(before)


@given(st.lists(st.floats(-0.03, 0.03), min_size=10, max_size=40))
def test_a_curtain_becomes_straight_and_stays_where_it_is(waves_m: list[float]) -> None:
    curtain = Walls(points=tuple((2 + wave_m, 0.1 * step) for step, wave_m in enumerate(waves_m)))
    before = world(curtain)
    after = cleaned(before, lambda text: None)
    assert len(wall_surfaces(after, 1.2)) == 1
    near = cKDTree(samples(wall_surfaces(after, 1.2)))
    away_m, _ = near.query(samples(wall_surfaces(before, 1.2)))
    assert np.max(away_m) < SMOOTH_M + 0.03  # samples are 5 cm apart


def test_a_plan_of_specks_only_is_refused() -> None:
    with pytest.raises(WorldError, match="all its walls are specks"):
        cleaned(world(speck(1, 1)), print)


@pytest.mark.parametrize(
    ("name", "m2", "rooms"), [("room_100", 100, 1), ("three_room_450", 450, 3)]
)
def test_check_tells_the_reachable_area_and_the_rooms(name: str, m2: int, rooms: int) -> None:
    (line,) = (fact for fact in facts(load_world(name)) if fact.startswith("reachable"))
    area_m2 = float(line.partition("about ")[2].split()[0])
    assert area_m2 == pytest.approx(m2, rel=0.05)
    assert f" {rooms} room" in line
