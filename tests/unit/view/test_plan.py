"""Tests the plan in two dimensions, and where the camera has the scene in view."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import Pose, Sketch, WallSegment
from companion.view.scene.camera import ELEVATION_RAD, FIELD_RAD, OVER_SHEET, _eye, _framed
from companion.view.scene.plan import Placed, plan_svg

ROOM = tuple(
    WallSegment(start, end, 0.03, 100)
    for start, end in (((0, 0), (0, 10)), ((0, 10), (6, 10)), ((6, 10), (6, 0)), ((6, 0), (0, 0)))
)
HERE = Pose(1.0, 3.0, 5.0, -1.2, 0.0)


def lines(svg: str, kind: str) -> list[tuple[float, ...]]:
    """Ends x1, y1, x2, y2 of the lines of a kind."""
    found = re.findall(rf'<line class="{kind}" x1="(.+?)" y1="(.+?)" x2="(.+?)" y2="(.+?)"/>', svg)
    return [tuple(map(float, line)) for line in found]


def test_each_wall_is_drawn_once_with_north_up() -> None:
    svg = plan_svg(Sketch(ROOM), HERE, "#3a86c8", Placed(), ())
    south, east, *_ = lines(svg, "wall")
    assert len(lines(svg, "wall")) == len(ROOM)
    assert south[1] == pytest.approx(south[3])
    assert east[3] < east[1]  # north is up
    assert 'class="drone"' in svg


def test_lengths_have_tolerances() -> None:
    svg = plan_svg(Sketch(ROOM), None, "#3a86c8", Placed(), ())
    assert (
        re.findall(r">(\d+\.\d\d ± \d\.\d\d)<", svg) == ["10.00 ± 0.08"] * 2 + ["6.00 ± 0.08"] * 2
    )


def test_a_map_lies_over_the_building_that_it_is_of() -> None:
    building = [((2.0, 1.0), (2.0, 7.0))]
    seen = WallSegment((0.0, 0.0), (6.0, 0.0), 0.03, 100)  # straight ahead of a drone facing east
    svg = plan_svg(Sketch((seen,)), None, "#3a86c8", Placed((2.0, 1.0), math.pi / 2), building)
    assert lines(svg, "wall") == lines(svg, "true")


@given(st.lists(st.tuples(*[st.floats(-30, 30)] * 4), max_size=30))
def test_lengths_never_lie_on_each_other(ends: list[tuple[float, float, float, float]]) -> None:
    walls = tuple(WallSegment((a, b), (c, d), 0.03, 100) for a, b, c, d in ends if (a, b) != (c, d))
    svg = plan_svg(Sketch(walls), None, "#3a86c8", Placed(), ())
    texts = re.findall(r'<text x="(.+?)" y="(.+?)">', svg)
    places = np.array(texts, dtype=float).reshape(-1, 2)
    apart = np.abs(places[:, None] - places)
    assert (np.triu((apart[..., 0] < 36) & (apart[..., 1] < 10), 1) == 0).all()


@pytest.mark.parametrize(
    ("aspect", "share"), [(632 / 720, 1.0), (1272 / 1080, 1.0), (0.46, OVER_SHEET)]
)
def test_the_whole_building_is_in_view_and_on_a_phone_above_the_sheet(
    aspect: float, share: float
) -> None:
    least, most = (0.0, 0.0), (10.0, 24.0)
    centre, distance_m = _framed(least, most, aspect, share)
    eye = np.array(_eye(centre, distance_m))
    up = np.array([0.0, math.sin(ELEVATION_RAD), math.cos(ELEVATION_RAD)])
    forward = np.array([0.0, math.cos(ELEVATION_RAD), -math.sin(ELEVATION_RAD)])
    corners = np.array([(east, north, 0.0) for east in (0, 24) for north in (0, 10)]) - eye
    depth_m = corners @ forward * math.tan(FIELD_RAD / 2)
    assert (np.abs(corners[:, 0] / depth_m) <= aspect).all()
    height = 0.5 + 0.5 * (corners @ up) / depth_m  # 0 below to 1 above
    assert height.min() >= 1 - share
    assert height.max() <= 1
