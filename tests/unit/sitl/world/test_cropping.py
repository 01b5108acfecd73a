"""Tests of cropped worlds: the inside is unchanged, and the border is closed."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import Vector2
from sitl.running.options import FlightOptions
from sitl.world.cropping import cropped
from sitl.world.format import World, WorldError
from sitl.world.geometry.mesh import visible_mesh
from sitl.world.geometry.model import WorldModel
from tests.examples import examples

SIDE_M = 10.0
FAR_M = 200.0


def building(**more: object) -> World:
    """Rooms along a hall, 60 × 20 m."""
    hall = {
        "points": [(10, 0), (10, 60)],
        "thickness_m": 0.2,
        "doors": [{"centre": (10, 20), "width_m": 1.2}, {"centre": (10, 25.2), "width_m": 1.2}],
    }
    return World.model_validate(
        {
            "name": "long",
            "height_m": 2.6,
            "walls": [
                {"points": [(0, 0), (20, 0), (20, 60), (0, 60)], "closed": True},
                hall,
                {"points": [(10, 22), (20, 24)]},
            ],
            "boxes": [
                {"corner": (6, 14), "size": (0.6, 3), "top_m": 0.8},
                {"corner": (12, 50), "size": (1, 1), "top_m": 2.0},
            ],
            "starts": [
                {"name": "west", "position": (5, 5)},
                {"name": "middle", "position": (8, 20)},
                {"name": "near", "position": (7, 18)},
                {"name": "at the border", "position": (8, 24.8)},
            ],
            **more,
        }
    )


def test_the_chosen_start_is_first_and_starts_outside_are_removed() -> None:
    piece = cropped(building(), SIDE_M, 1)
    assert [start.name for start in piece.starts] == ["middle", "near"]


def test_the_cropped_area_is_a_square_around_the_start() -> None:
    assert cropped(building(), SIDE_M, 1).bounds == ((3, 15), (13, 25))


def test_boxes_end_at_the_border() -> None:
    [box] = cropped(building(), SIDE_M, 1).boxes
    assert box.corner == (6, 15)
    assert box.size == pytest.approx((0.6, 2))


PLACES = st.tuples(st.floats(3.3, 9.5), st.floats(15.3, 24.7))


@settings(max_examples=examples(60), deadline=None)
@given(PLACES, st.floats(0, math.tau), st.sampled_from([0.4, 1.2, 2.3]))
def test_ranges_inside_are_unchanged_up_to_the_closed_border(
    place: Vector2, bearing_rad: float, height_m: float
) -> None:
    origin = (*place, -height_m)
    ray = (math.cos(bearing_rad), math.sin(bearing_rad), 0.0)
    before_m = BEFORE.range_m(origin, ray, FAR_M)
    to_border_m = min(
        ((high if step > 0 else low) - at) / step
        for at, step, low, high in zip(place, ray, (3, 15), (13, 25), strict=False)
        if step
    )
    assert before_m is not None
    assert AFTER.range_m(origin, ray, FAR_M) == pytest.approx(min(before_m, to_border_m), abs=1e-6)


BEFORE, AFTER = WorldModel(building()), WorldModel(cropped(building(), SIDE_M, 1))


def test_a_world_smaller_than_the_square_stays_complete() -> None:
    whole = building()
    piece = cropped(whole, 200.0, 1)
    assert len(piece.walls) == 1 + len(whole.panels)
    assert [box.corner for box in piece.boxes] == [box.corner for box in whole.boxes]
    assert [start.name for start in piece.starts][:2] == ["middle", "west"]


def test_a_mesh_cannot_be_cropped() -> None:
    with pytest.raises(WorldError, match="mesh"):
        cropped(building(mesh=visible_mesh(building())), SIDE_M, 0)


def test_a_flight_uses_the_cropped_world_and_its_first_start() -> None:
    setup, _ = FlightOptions("exterior", 1, "paper", "ardupilot", crop_m=SIDE_M).setup()
    (south, west), (north, east) = setup.world.bounds
    assert (north - south, east - west) == (SIDE_M, SIDE_M)
    assert setup.start == 0
