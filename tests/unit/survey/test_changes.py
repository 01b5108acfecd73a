"""Tests that a survey finds what has changed between its flights."""

import math
from itertools import pairwise

import numpy as np
import pytest

from companion.config import settings
from companion.core.arrays import Array
from companion.core.frames import frd_to_ned
from companion.core.messages import BEARING_FRD_RAD, RangeUnit
from companion.drivers.chips.sharp import PAPER
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import CALIBRATION_SIZE, Measured, Unknowns
from companion.survey.changes import Change, changes, joined
from sitl.running.sorties import Sortie, Sorties
from sitl.sensors.beam import RAY
from sitl.simulation.simulation import Setup
from sitl.testing.flight import ReportView
from sitl.world.format import Box, Walls, World

pytestmark = pytest.mark.flights

HEIGHT_M, FRONT_M = 2.6, 0.6
PAD_NE_M = 2.2, 3.0
JAMBS = (2.2, 3.4)
"""East of the doorway's sides, m."""


def two_rooms(cupboard_east_m: float, *, door_is_shut: bool) -> World:
    """Rooms of 4.4 and 8.4 m by 6 m with a doorway of 1.2 m, and a cupboard at the south wall."""
    outer = Walls(points=((0, 0), (13, 0), (13, 6), (0, 6)), closed=True)
    partition = [
        Walls(points=((4.4, end), (4.4, jamb), (4.6, jamb), (4.6, end)))
        for end, jamb in zip((0, 6), JAMBS, strict=True)
    ]
    door = [Walls(points=tuple((4.45, jamb) for jamb in JAMBS))] if door_is_shut else []
    cupboard = Box(corner=(0.0, cupboard_east_m), size=(FRONT_M, 1.4), bottom_m=0.0, top_m=2.0)
    return World(
        name="two rooms",
        height_m=HEIGHT_M,
        walls=(outer, *partition, *door),
        boxes=(cupboard,),
        starts=({"name": "pad", "position": PAD_NE_M, "heading_deg": 30},),
    )


@pytest.fixture(scope="module")
def sorties() -> list[Sortie]:
    """The cupboard is moved by 2.2 m and the door is shut after the first flight."""
    before, after = two_rooms(2.0, door_is_shut=False), two_rooms(4.2, door_is_shut=True)
    config = settings.load(None, {"mission.kind": "building", "mission.time_limit_s": 120.0})
    setup = Setup(before, "two rooms", 2, config.sensors, "ardupilot", {}, RAY, battery_s=120.0)
    return list(Sorties(setup, config, lambda _: None, tell=print, then=after).fly(3))


def test_changes_that_continue_each_other_are_one() -> None:
    """A door that was shut between two walls of the map was listed in two pieces."""
    door, rest = ((0.0, 1.0), (0.02, 1.7)), ((0.03, 2.4), (0.02, 1.75))
    [whole] = joined([Change(True, 1, *door), Change(True, 1, *rest)])
    assert {whole.start_ne_m, whole.end_ne_m} == {(0.0, 1.0), (0.03, 2.4)}
    around_a_corner = Change(True, 1, (0.02, 1.75), (0.7, 1.75))
    of_another_flight = Change(True, 2, *rest)
    gone = Change(False, 1, *rest)
    beyond_a_gap = Change(True, 1, (0.0, 2.0), (0.0, 2.5))
    on_top = Change(True, 1, (0.05, 1.7), (0.05, 1.1))
    for other in (around_a_corner, of_another_flight, gone, beyond_a_gap, on_top):
        assert len(joined([Change(True, 1, *door), other])) == 2


WALL_M, BEHIND_M = 2.0, 4.0
"""North of a wall from west to east, and of what stands behind it."""


def listed(flights: list[tuple[Array, Array]]) -> tuple[Change, ...]:
    """Changes along a wall, by flights with beams to the north.

    Each flight has beams (n,) that ended on the wall and others (m,) that passed, by their east, m.
    """
    east_m = np.concatenate([np.concatenate(beams) for beams in flights])
    distance_m = np.concatenate(
        [np.repeat([WALL_M, BEHIND_M], [len(beams) for beams in each]) for each in flights]
    )
    flight = np.repeat(np.arange(len(flights)), [sum(map(len, each)) for each in flights])
    count, nothing = len(flights), np.zeros(len(flights) - 1)
    zeros = np.zeros(len(east_m))
    m = Measured(
        dt_s=nothing + 1.0,
        age_s=nothing,
        moved_frd_m=np.zeros((count - 1, 2)),
        turned_rad=nothing,
        autopilot_yaw_rad=np.full(count, np.nan),
        bias_moved_rad_s=nothing,
        is_aided=nothing > 0,
        frame=flight,
        beam=zeros.astype(int),
        offset_frd_m=np.column_stack([zeros, east_m]),
        bearing_rad=zeros,
        distance_m=distance_m,
        mount_m=zeros,
        averaged_frd_m=np.zeros((count - 1, 2)),
        begins=tuple(range(count)),
    )
    reach_m = np.array([[east_m.min(), east_m.max()]])
    calibration = np.zeros((count, CALIBRATION_SIZE))
    x = Unknowns(np.zeros((count, 6)), np.array([[0.0, WALL_M]]), reach_m, calibration)
    units = RangeUnits({beam: RangeUnit(PAPER, at, 0.0) for beam, at in BEARING_FRD_RAD.items()})
    return changes(x, m, np.where(distance_m == WALL_M, 0, NO_WALL), units).listed


def beams(*stretches_m: tuple[float, float]) -> Array:
    """Easts of beams along stretches, m, one each centimetre."""
    return np.concatenate([np.arange(low_m, high_m, 0.01) for low_m, high_m in stretches_m])


@pytest.mark.parametrize(("passed_m", "is_listed"), [(0.2, False), (0.8, True)])
def test_both_sides_of_a_doorway_are_not_one_change(passed_m: float, *, is_listed: bool) -> None:
    """Beams of the second flight pass the jambs closely: a changed wall was listed across them."""
    sides = (3.0 - passed_m, 3.0), (4.0, 4.0 + passed_m)
    first = beams((0.0, 3.0), (4.0, 7.0)), beams((3.05, 3.95))
    second = beams((0.0, 3.0 - passed_m), (4.0 + passed_m, 7.0)), beams(*sides)
    found = listed([first, second])
    assert len(found) == (2 if is_listed else 0)
    for change in found:
        assert change.length_m == pytest.approx(passed_m, abs=0.25)


def in_world(change: Change) -> list[tuple[float, float]]:
    """Ends of a change, north and east in the world, m."""
    ends = (change.start_ne_m, change.end_ne_m)
    turned = (frd_to_ned(*end, math.radians(30)) for end in ends)
    return [(PAD_NE_M[0] + north_m, PAD_NE_M[1] + east_m) for north_m, east_m in turned]


def test_a_shut_door_and_a_moved_cupboard_are_listed(sorties: list[Sortie]) -> None:
    changes = sorties[-1].merged.changes
    fronts = [("gone", FRONT_M, 2.7), ("new", FRONT_M, 4.9), ("new", 4.45, 2.8)]
    """State, north, and east of the middle of what has changed."""
    found = []
    for change in changes:
        (from_north_m, from_east_m), (to_north_m, to_east_m) = in_world(change)
        assert math.dist((from_north_m, from_east_m), (to_north_m, to_east_m)) > 0.8
        north_m, east_m = (from_north_m + to_north_m) / 2, (from_east_m + to_east_m) / 2
        found.append(("new" if change.is_new else "gone", north_m, east_m))
        assert change.flight == 1
        assert "since flight 2: wall from" in change.in_words("flight 2")
    for state, north_m, east_m in fronts:
        assert any(
            each[0] == state and math.dist(each[1:], (north_m, east_m)) < 0.5 for each in found
        ), (state, north_m, east_m, found)


def test_the_map_shows_the_building_as_the_last_flight_found_it(sorties: list[Sortie]) -> None:
    joint = ReportView(sorties[-1].joint)
    assert joint.collisions == 0
    assert joint.coverage > 0.9
    assert joint.false_walls < 0.01
    assert joint.wall_error_aligned_cm < 4
    assert joint.clearance_open_m > 0


def test_an_unchanged_building_has_no_changes(sorties: list[Sortie]) -> None:
    assert not sorties[0].merged.changes
    for earlier, later in pairwise(sorties[1:]):
        assert len(later.merged.changes) == len(earlier.merged.changes)
