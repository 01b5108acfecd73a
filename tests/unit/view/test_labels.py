"""Tests that labels of the scene never lie on each other, whatever the camera."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.view.scene.labels import Label, View, boxes, free

SIZES_PX = ((1280, 720), (1920, 1080), (390, 844))


def looking(at_m: tuple[float, float], away_m: float, azimuth: float, elevation: float) -> View:
    """A camera that looks at a place on the floor; angles in rad."""
    to_eye = np.array(
        [
            math.cos(elevation) * math.cos(azimuth),
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
        ]
    )
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    east, north, up = np.array([*at_m, 0.0]) + away_m * to_eye
    axes = np.column_stack([right, np.cross(-to_eye, right), -to_eye])
    return View((east, north, up), axes, math.radians(40), *SIZES_PX[0])


places = st.tuples(st.floats(-10, 10), st.floats(-10, 10), st.floats(0, 2))
labels = st.builds(Label, st.text("0123456789. ±m", min_size=1, max_size=30), places)
views = st.builds(
    looking,
    st.tuples(st.floats(-10, 10), st.floats(-10, 10)),
    st.floats(1, 60),
    st.floats(-3, 3),
    st.floats(0.1, 1.5),
)


@given(st.lists(labels, max_size=40), views, st.sampled_from(SIZES_PX))
def test_labels_lie_in_the_window_and_never_on_each_other(
    shown: list[Label], view: View, size_px: tuple[int, int]
) -> None:
    width_px, height_px = size_px
    view = View(view.eye_enu_m, view.axes, view.field_rad, width_px, height_px)
    its = boxes(shown, view)[free(shown, view)]
    assert (its[:, :2] >= 0).all()
    assert (its[:, 2:] <= (width_px, height_px)).all()
    for number, (left, top, right, bottom) in enumerate(its):
        others = its[number + 1 :]
        beside = (others[:, 0] >= right) | (others[:, 2] <= left)
        above = (others[:, 1] >= bottom) | (others[:, 3] <= top)
        assert (beside | above).all()


def test_the_first_of_two_labels_in_one_place_is_shown() -> None:
    view = looking((0, 0), 20, -math.pi / 2, 1.0)
    here, there = (0.0, 0.0, 0.0), (5.0, 0.0, 0.0)
    shown = [Label("10.00 ± 0.09 m", here), Label("4.00 ± 0.09 m", here), Label("map", there)]
    assert free(shown, view).tolist() == [True, False, True]


def test_a_label_stands_above_its_place() -> None:
    view = looking((0, 0), 20, -math.pi / 2, 1.0)
    [[left, top, right, bottom]] = boxes([Label("map", (0.0, 0.0, 0.0))], view)
    assert (left + right) / 2 == pytest.approx(640)
    assert top < bottom == pytest.approx(360)


def test_what_is_behind_the_camera_has_no_label() -> None:
    view = looking((0, 0), 20, -math.pi / 2, 0.2)
    assert not free([Label("map", (0.0, -50.0, 4.0))], view).any()
