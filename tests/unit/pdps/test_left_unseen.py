"""Tests the list of unseen places and its message."""

import math

import pytest

from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray, Rays
from companion.pdps.frontiers import Places
from companion.pdps.left_unseen import in_words, left_unseen

AHEAD_M, ASIDE_M = 2.0, 0.5
"""Distance of the north wall, where beams into the opening end, and the opening's offset to the
right, m."""


def room_with_an_opening(wide_m: float) -> Occupancy:
    """Room of 4 × 4 m round the start, with an opening in its north wall, 0.5 m to the right.

    No beam has passed through the opening.
    """
    grid, rays = Occupancy(), []
    for tenth in range(3600):
        bearing_rad = math.radians(tenth / 10)
        to_m = AHEAD_M / max(abs(math.cos(bearing_rad)), abs(math.sin(bearing_rad)))
        is_north = math.cos(bearing_rad) > 0 and abs(math.tan(bearing_rad)) < 1
        in_it = is_north and abs(AHEAD_M * math.tan(bearing_rad) - ASIDE_M) < wide_m / 2
        rays.append(Ray((0.0, 0.0), bearing_rad, to_m, 0.01, not in_it, 0.0))
    grid.draw(Rays.of(3 * rays))
    return grid


@pytest.mark.parametrize("wide_m", [0.8, 1.2])
def test_an_opening_that_no_beam_has_passed_is_listed(wide_m: float) -> None:
    [(north_m, east_m)] = left_unseen(room_with_an_opening(wide_m))
    assert north_m == pytest.approx(AHEAD_M, abs=0.2)
    assert east_m == pytest.approx(ASIDE_M, abs=0.4)


def test_a_closed_room_has_no_unseen_places() -> None:
    assert left_unseen(room_with_an_opening(0.0)) == ()


@pytest.mark.parametrize(
    ("places", "words"),
    [
        ((), ""),
        (((4.04, -2.5),), "left unseen: 4.0 m north 2.5 m west"),
        (
            ((-1.0, 0.0),) * 5,
            "left unseen: " + ", ".join(["1.0 m south 0.0 m east"] * 3) + " and 2 more",
        ),
    ],
)
def test_the_message_contains_the_first_unseen_places(places: Places, words: str) -> None:
    assert in_words(places) == words
