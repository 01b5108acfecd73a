"""Tests how two drones divide the round of a room."""

import math

import numpy as np
import pytest

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.messages import Pose
from companion.mapping.occupancy import Occupancy
from companion.navigation.observation import Observation, Tracing
from companion.pdps import room_scan
from companion.pdps.room_halves import divided, has_met, other_wall_rad
from companion.pdps.room_scan_state import RoomScan, ScanPhase

SCAN = RoomScan(ScanPhase.SCAN, corners=1)
FAR_M = 9.0


def tracing(
    ne_m: Vector2,
    side: int = 0,
    *,
    comes_first: bool = True,
    is_tracing: bool = True,
    wall_rad: float | None = 0.0,
    track: tuple[Vector2, ...] = (),
) -> Tracing:
    places = np.array(track).reshape(-1, 2)
    return Tracing(ne_m, wall_rad, side, True, is_tracing, places, comes_first)


def beside(other: Tracing) -> Observation:
    """This drone hovers at its start and faces north."""
    return Observation(Pose(0.0, 0.0, 0.0, -1.2, 0.0), {}, 0.08, tracings=(other,))


@pytest.mark.parametrize(("east_m", "side"), [(2.0, -1), (-2.0, 1)])
def test_the_first_drone_goes_away_from_the_other(east_m: float, side: int) -> None:
    other = tracing((0.0, east_m), comes_first=False, is_tracing=False)
    assert divided(RoomScan(), beside(other)).side == side


@pytest.mark.parametrize("side", [1, -1])
def test_the_other_drone_goes_the_opposite_way(side: int) -> None:
    assert divided(RoomScan(), beside(tracing((0.0, 2.0), side))).side == -side


def test_a_drone_alone_goes_clockwise() -> None:
    alone = Observation(Pose(0.0, 0.0, 0.0, -1.2, 0.0), {}, 0.08)
    assert divided(RoomScan(), alone).side == 1
    assert not has_met(SCAN, alone, FAR_M)


def test_both_begin_at_the_wall_of_the_first() -> None:
    at_right = tracing((0.0, 2.0), wall_rad=0.5 * math.pi)
    assert other_wall_rad(0.0, beside(at_right)) == 0.5 * math.pi
    assert other_wall_rad(0.5 * math.pi + 0.1, beside(at_right)) is None
    waiting = tracing((0.0, 2.0), wall_rad=0.5 * math.pi, comes_first=False, is_tracing=False)
    assert other_wall_rad(0.0, beside(waiting)) is None


@pytest.mark.parametrize("phase", [ScanPhase.TURN, ScanPhase.SEEK])
def test_a_drone_without_a_wall_in_range_goes_to_that_of_the_other(phase: ScanPhase) -> None:
    """It flew straight on until any wall returned, and came to the round when it was over."""
    at_right = tracing((0.0, 2.0), wall_rad=0.5 * math.pi)
    turned = RoomScan(phase, turned_rad=math.tau)
    grid, plan = Occupancy(), MissionConfig()
    scan, setpoint = room_scan.step(turned, beside(at_right), grid, plan)
    assert (scan.phase, scan.heading_rad) == (ScanPhase.FACE, 0.5 * math.pi)
    assert (setpoint.forward_m_s, setpoint.right_m_s) == (0.0, 0.0)
    not_yet = tracing((0.0, 2.0), wall_rad=None)
    assert room_scan.step(turned, beside(not_yet), grid, plan)[0].phase is not ScanPhase.FACE


def test_the_one_that_comes_second_leaves_when_they_meet() -> None:
    coming = tracing((0.0, 3.0), side=-1)
    assert has_met(SCAN, beside(coming), FAR_M)
    assert not has_met(SCAN, beside(tracing((0.0, 3.0), side=-1, comes_first=False)), FAR_M)
    assert not has_met(SCAN, beside(tracing((0.0, 5.0), side=-1)), FAR_M)
    assert not has_met(SCAN, beside(tracing((0.0, -3.0), side=-1)), FAR_M)


def test_drones_meet_at_a_corner() -> None:
    """The next wall is 2 m ahead, and the other drone comes along it."""
    coming = tracing((-1.5, 2.0), side=-1)
    assert has_met(SCAN, beside(coming), 2.0)
    assert not has_met(SCAN, beside(coming), FAR_M)


def test_the_first_drone_ends_where_the_other_has_been() -> None:
    """It does not matter whether the other still flies."""
    been = ((0.3, 3.0), (0.2, 0.2))
    for is_tracing in (True, False):
        other = tracing((9.0, 9.0), -1, comes_first=False, is_tracing=is_tracing, track=been)
        assert has_met(SCAN, beside(other), FAR_M)
    assert not has_met(SCAN, beside(tracing((9.0, 9.0), -1, track=been[:1])), FAR_M)


def test_drones_that_begin_side_by_side_have_not_met() -> None:
    other = tracing((0.0, 2.0), side=-1, track=((0.0, 0.3),))
    assert not has_met(RoomScan(ScanPhase.SCAN), beside(other), FAR_M)
