"""Conversions of frames, and wrapping of angles."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import frd_to_ned, ned_to_enu, ned_to_frd, wrap_rad

ANGLE = st.floats(-100, 100)
LENGTH = st.floats(-1000, 1000)


@given(ANGLE)
def test_wrapping_keeps_the_direction(angle: float) -> None:
    wrapped = wrap_rad(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(LENGTH, LENGTH, ANGLE)
def test_frd_to_ned_and_back_is_the_identity(forward: float, right: float, yaw: float) -> None:
    assert ned_to_frd(*frd_to_ned(forward, right, yaw), yaw) == pytest.approx((forward, right))


def test_yaw_is_clockwise_from_north() -> None:
    assert frd_to_ned(1.0, 0.0, math.pi / 2) == pytest.approx((0.0, 1.0))
    assert frd_to_ned(0.0, 1.0, 0.0) == pytest.approx((0.0, 1.0))


def test_enu_is_its_own_inverse() -> None:
    assert ned_to_enu((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)
    assert ned_to_enu(ned_to_enu((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)
