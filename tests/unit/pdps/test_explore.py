"""Tests the phases of exploration: look, choose, go."""

import math
from dataclasses import replace

import pytest

from companion.core.messages import HOLD
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.navigation.doorway_claims import WAIT_WITHIN_M
from companion.navigation.doorways import Doorway
from companion.navigation.observation import Claim
from companion.navigation.travel_state import Travel, TravelPhase
from companion.pdps.explore import Explore, ExplorePhase, step
from companion.pdps.viewpoints import Viewpoint
from tests.grids import (
    NORTH,
    PLAN,
    observation,
    open_ground,
    stuck_on_a_path,
    walled,
)


def test_a_place_where_travel_gave_up_is_stored_for_the_next_travel() -> None:
    explore, grid = going(open_ground()), open_ground()
    assert explore.look is not None
    stuck = replace(explore, travel=stuck_on_a_path(None))
    after, _ = step(stuck, observation(), grid, PLAN)
    assert after.phase is ExplorePhase.CHOOSE
    assert after.came is not None
    assert len(after.came.stuck_at) == 1


def test_look_turns_360_degrees_and_then_a_viewpoint_is_chosen() -> None:
    explore, grid, yaw_rad = Explore(), open_ground(), 0.0
    while explore.phase is ExplorePhase.LOOK:
        explore, setpoint = step(explore, observation(yaw_rad=yaw_rad), grid, PLAN)
        yaw_rad += 0.1
        assert setpoint.forward_m_s == pytest.approx(0, abs=1e-9)
    assert yaw_rad > math.tau
    assert chosen(explore, grid).phase is ExplorePhase.GO


def test_the_mission_ends_after_a_look_if_no_frontier_is_left() -> None:
    explore, _ = step(Explore(to_turn_rad=-0.1), observation(), walled(reach_m=2.0), PLAN)
    assert chosen(explore, walled(reach_m=2.0)).phase is ExplorePhase.DONE


def test_look_ends_early_when_all_its_targets_are_seen() -> None:
    looking = Explore(look=Viewpoint((0.0, 0.0), ((3.9, 0.0),)), to_turn_rad=3.0)
    explore, _ = step(looking, observation(), walled(reach_m=2.0), PLAN)
    assert chosen(explore, walled(reach_m=2.0)).phase is ExplorePhase.DONE


@pytest.mark.parametrize("north_m", [-1.0, 1.0])
def test_a_drone_waits_for_its_teammates_off_the_doorway(north_m: float) -> None:
    """The teammate looks at something elsewhere, and nothing is left for this drone."""
    doorway = Doorway(0, (2.5, 0.0), (1.0, 0.0), 0.5)
    elsewhere = Claim(((9.0, 9.0),), 5.0, is_extra=False, comes_first=True, from_ne_m=(8.0, 8.0))
    here, grid = (north_m, 0.0), walled()
    now = replace(observation(here), claims=(elsewhere,))
    explore = Explore(ExplorePhase.CHOOSE, came=Travel(here, known=(doorway,)))
    while explore.phase is ExplorePhase.CHOOSE:
        explore, _ = step(explore, now, grid, PLAN)
    assert explore.phase is ExplorePhase.WAIT
    is_in_the_way = math.dist(here, doorway.middle_ne_m) < WAIT_WITHIN_M
    waiting_place = explore.travel.goal_ne_m if explore.travel else explore.here_ne_m
    assert waiting_place is not None
    assert (explore.travel is not None) == is_in_the_way
    assert math.dist(waiting_place, doorway.middle_ne_m) > WAIT_WITHIN_M - CELL_M
    arrived = replace(
        now, pose=replace(now.pose, north_m=waiting_place[0], east_m=waiting_place[1])
    )
    for _ in range(3):
        explore, _ = step(explore, arrived, grid, PLAN)
    assert explore.phase is ExplorePhase.WAIT
    assert explore.travel is None


def chosen(explore: Explore, grid: Occupancy) -> Explore:
    """The state after CHOOSE."""
    assert explore.phase is ExplorePhase.CHOOSE
    while explore.phase is ExplorePhase.CHOOSE:
        explore, _ = step(explore, observation(), grid, PLAN)
    return explore


def going(grid: Occupancy) -> Explore:
    explore = chosen(Explore(ExplorePhase.CHOOSE), grid)
    assert explore.phase is ExplorePhase.GO
    return explore


def test_go_changes_to_look_on_arrival() -> None:
    explore = going(open_ground())
    assert explore.travel is not None
    there = observation(explore.travel.goal_ne_m)
    explore, _ = step(explore, there, open_ground(), PLAN)
    assert explore.phase is ExplorePhase.LOOK
    assert explore.look is not None


def arrived(*bearings_deg: float, yaw_rad: float = 0.0) -> Explore:
    """A viewpoint at the origin with targets at the edge of known space in these directions."""
    rim = [
        (3.95 * math.cos(math.radians(b)), 3.95 * math.sin(math.radians(b))) for b in bearings_deg
    ]
    here = (0.0, 0.0)
    going = Explore(
        ExplorePhase.GO, travel=Travel(here, course=NORTH), look=Viewpoint(here, tuple(rim))
    )
    return step(going, observation(here, yaw_rad=yaw_rad), open_ground(), PLAN)[0]


@pytest.mark.parametrize("clockwise", [True, False])
def test_the_drone_turns_in_the_direction_that_reaches_the_targets_sooner(clockwise: bool) -> None:
    side = 1 if clockwise else -1
    for ahead, beside in ((20, 30), (100, 110)):
        looking = arrived(side * ahead, side * beside)
        assert looking.phase is ExplorePhase.LOOK
        assert looking.clockwise is clockwise
        assert math.radians(20) < looking.to_turn_rad < math.radians(60)


def test_the_drone_does_not_turn_when_all_targets_were_seen_on_the_way() -> None:
    here = (0.0, 0.0)
    going = Explore(
        ExplorePhase.GO, travel=Travel(here, course=NORTH), look=Viewpoint(here, ((1.0, 0.0),))
    )
    explore, _ = step(going, observation(here), open_ground(), PLAN)
    assert explore.phase is ExplorePhase.CHOOSE


def test_the_drone_continues_to_its_viewpoint_while_it_turns() -> None:
    looking = replace(arrived(100), here_ne_m=(0.0, 1.5))
    _, setpoint = step(looking, observation(), open_ground(), PLAN)
    assert setpoint.right_m_s > 0.5
    assert setpoint.yaw_rate_rad_s > 0


def test_go_takes_another_viewpoint_where_there_is_no_path() -> None:
    explore = going(open_ground())
    stuck = replace(explore, travel=Travel((9.0, 9.0), phase=TravelPhase.GAVE_UP))
    another, _ = step(stuck, observation(), open_ground(), PLAN)
    assert another.tried == (explore.look,)
    assert chosen(another, open_ground()).phase is ExplorePhase.GO


def test_activity_distinguishes_frontiers_from_walls_to_measure_again() -> None:
    explore = going(open_ground())
    assert explore.activity == "going to where something is unseen"
    assert explore.look is not None
    tie = replace(explore, look=replace(explore.look, is_tie=True))
    assert tie.activity == "going to look again at walls that are not known well"


def test_go_chooses_again_when_its_targets_were_seen_on_the_way() -> None:
    explore = going(open_ground())
    explore, setpoint = step(explore, observation(time_s=20.0), open_ground(reach_m=9.0), PLAN)
    assert explore.phase is ExplorePhase.CHOOSE
    assert setpoint != HOLD  # the drone continues to fly meanwhile
    assert chosen(explore, walled(reach_m=2.0)).phase is ExplorePhase.DONE


def test_a_viewpoint_whose_targets_were_seen_on_the_way_counts_as_tried() -> None:
    explore = going(open_ground())
    after, _ = step(explore, observation(time_s=20.0), walled(reach_m=2.0), PLAN)
    assert explore.look is not None
    assert [look.at_ne_m for look in after.tried] == [explore.look.at_ne_m]


def test_done_stays_done() -> None:
    explore, setpoint = step(Explore(ExplorePhase.DONE), observation(), walled(), PLAN)
    assert explore.phase is ExplorePhase.DONE
    assert setpoint == HOLD
