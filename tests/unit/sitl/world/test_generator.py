"""Tests of random buildings: a drone can fly in them for every seed."""

import hashlib
import math
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.spatial import cKDTree

from companion.core.arrays import Indices
from companion.core.frames import Vector2
from sitl.world.format import Box, Segment, Walls, World, WorldError
from sitl.world.generator import named, random_world
from sitl.world.geometry.model import WorldModel
from sitl.world.loading import load_world
from sitl.world.plan import samples, wall_surfaces
from tests.examples import examples

GRID_M = 0.1
PASSABLE_M = 0.5
HEIGHTS_M = (0.3, 0.72, 1.2, 1.9)
"""Each height intersects different furniture."""
BEFORE_DOOR_M = 1.25
TOUCH_M = 0.001

seeds = st.integers(0, 10**9)
each_building = settings(max_examples=examples(12), deadline=None)


def doors(world: World) -> list[tuple[Segment, Vector2, float, float]]:
    """Wall, centre, width and height of every door."""
    return [
        (segment, door.centre, door.width_m, door.height_m)
        for walls in world.walls
        for door in walls.doors
        for segment in walls.segments
    ]


def either_side(wall: Segment, centre: Vector2, off_m: float) -> list[Vector2]:
    (north, east), (to_north, to_east) = wall
    length_m = math.dist(*wall)
    across = (east - to_east) * off_m / length_m, (to_north - north) * off_m / length_m
    return [(centre[0] + side * across[0], centre[1] + side * across[1]) for side in (1, -1)]


def reachable(world: World) -> Indices:
    """Labels of the cells by connected area, free at all heights for a disc of radius 0.5 m."""
    north_m, east_m = world.bounds[1]
    norths = GRID_M * np.arange(round(north_m / GRID_M) + 1)
    easts = GRID_M * np.arange(round(east_m / GRID_M) + 1)
    cells = np.stack(np.meshgrid(norths, easts, indexing="ij"), axis=-1)
    surfaces = {wall for height_m in HEIGHTS_M for wall in wall_surfaces(world, height_m)}
    tree = cKDTree(samples(sorted(surfaces)))
    to_surface_m, _ = tree.query(cells, distance_upper_bound=2 * PASSABLE_M)
    parts, _ = ndimage.label(to_surface_m >= PASSABLE_M - 1e-6)
    return np.asarray(parts)


def cell(place: Vector2) -> tuple[int, int]:
    return round(place[0] / GRID_M), round(place[1] / GRID_M)


@each_building
@given(seeds)
def test_every_room_can_be_reached_from_every_start(seed: int) -> None:
    world = random_world(seed)
    parts = reachable(world)
    places = [start.position for start in world.starts]
    for wall, centre, _, _ in doors(world):
        places += either_side(wall, centre, 0.7)
    assert len({int(parts[cell(place)]) for place in places}) == 1
    assert parts[cell(places[0])]


@each_building
@given(seeds)
def test_starts_are_free_and_in_different_rooms(seed: int) -> None:
    world = random_world(seed)
    model = WorldModel(world)
    assert 1 <= len(world.starts) <= 3
    assert len({start.name for start in world.starts}) == len(world.starts)
    for start in world.starts:
        assert start.heading_deg is None
        for height_m in HEIGHTS_M[:3]:
            assert model.clearance_m((*start.position, -height_m)) >= 0.8


@each_building
@given(seeds)
def test_buildings_have_realistic_sizes(seed: int) -> None:
    world = random_world(seed)
    (south, west), (north, east) = world.bounds
    assert (south, west) == (0, 0)
    assert 8 <= north <= 25
    assert 8 <= east <= 25
    assert 2.4 <= world.height_m <= 3
    assert all(0.1 <= walls.thickness_m <= 0.2 for walls in world.walls)
    assert doors(world)
    for _, _, width_m, height_m in doors(world):
        assert 1.0 <= width_m <= 1.4
        assert 2.0 <= height_m <= 2.1
    assert all(box.top_m <= world.height_m for box in world.boxes)


@each_building
@given(seeds)
def test_no_furniture_blocks_a_door(seed: int) -> None:
    """A beam through any part of a door is free on both sides, at every height of the door."""
    world = random_world(seed)
    model = WorldModel(world)
    for wall, centre, width_m, _ in doors(world):
        for aside_m in (-0.45 * width_m, 0.0, 0.45 * width_m):
            place = aside(wall, centre, aside_m)
            for ahead in either_side(wall, (0.0, 0.0), 1.0):
                for height_m in HEIGHTS_M:
                    origin = (*place, -height_m)
                    assert model.range_m(origin, (*ahead, 0.0), BEFORE_DOOR_M) is None


def aside(wall: Segment, centre: Vector2, by_m: float) -> Vector2:
    (north, east), (to_north, to_east) = wall
    share = by_m / math.dist(*wall)
    return centre[0] + share * (to_north - north), centre[1] + share * (to_east - east)


@each_building
@given(seeds)
def test_furniture_overlaps_no_wall_and_no_other_furniture(seed: int) -> None:
    world = random_world(seed)
    for one, other in combinations(world.boxes, 2):
        assert not overlap(corners(one), corners(other))
    outlines = [[start for start, _ in panel.outline] for panel in world.panels]
    for box in world.boxes:
        assert not any(overlap(corners(box), outline) for outline in outlines)


def corners(box: Box) -> list[Vector2]:
    return [start for start, _ in box.segments]


def overlap(one: list[Vector2], other: list[Vector2]) -> bool:
    """True if two convex outlines share area: no side of either separates them."""
    return not any(
        separates(start, end, one, other)
        for outline in (one, other)
        for start, end in pairwise([*outline, outline[0]])
    )


def separates(start: Vector2, end: Vector2, one: list[Vector2], other: list[Vector2]) -> bool:
    across = (start[1] - end[1], end[0] - start[0])
    length_m = math.hypot(*across)
    mine, others = (
        [(p[0] * across[0] + p[1] * across[1]) / length_m for p in outline]
        for outline in (one, other)
    )
    return max(mine) <= min(others) + TOUCH_M or max(others) <= min(mine) + TOUCH_M


def test_some_buildings_have_slanted_walls_and_some_are_empty() -> None:
    worlds = [random_world(seed) for seed in range(30)]
    slanted = [world for world in worlds if any(map(is_slanted, world.walls))]
    assert 3 <= len(slanted) <= 27
    assert 3 <= sum(not world.boxes for world in worlds) <= 27


def is_slanted(walls: Walls) -> bool:
    (north, east), (to_north, to_east) = walls.segments[0]
    return north != to_north and east != to_east


def _as_json(world: World) -> str:
    """JSON of the building's random parts; it has no known area and no glass."""
    return world.model_dump_json(exclude={"known": True, "walls": {"__all__": {"glass"}}})


def test_a_seed_gives_the_same_building_on_every_machine() -> None:
    digests = [
        hashlib.sha256(_as_json(random_world(seed)).encode()).hexdigest()[:8] for seed in (1, 17)
    ]
    assert digests == ["d0939978", "09d3e4af"]


def test_random_buildings_are_loaded_by_name() -> None:
    assert load_world("random_17") == random_world(17)
    assert load_world("random_large_17") == random_world(17, is_large=True)
    for name in ("random_0", "random_17", "random_large_17"):
        assert load_world(name).name == name
    assert not any(named(name) for name in ("random_017", "random_", "large_1", "room_100"))
    with pytest.raises(WorldError, match="random_17"):
        load_world("random_seventeen")


@given(seed=seeds)
@each_building
def test_large_buildings_are_more_than_a_battery_maps(seed: int) -> None:
    world = random_world(seed, is_large=True)
    north_m, east_m = world.bounds[1]
    assert 300 <= north_m * east_m <= 600
    reached = reachable(world)
    starts = [tuple(round(m / GRID_M) for m in start.position) for start in world.starts]
    assert len({int(reached[cell]) for cell in starts} - {0}) == 1
