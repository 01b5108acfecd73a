"""The drone stays below its greatest height and within its greatest distance."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.app import App
from companion.config.settings import Config, MissionConfig
from companion.core.frames import frd_to_ned
from companion.core.messages import Pose, RangeReading, RangeState, Setpoint
from companion.navigation.grid_planner import find_ground, find_ways
from companion.pdps import layers as layering
from companion.pdps.flight.phases import step
from companion.pdps.flight.state import Phase
from companion.pdps.layers import Layers, LayersPhase, fits_above
from companion.safety import fence
from companion.safety.obstacle_memory import Surroundings
from companion.safety.separation import passing_from
from companion.safety.velocity_guard import guarded
from tests.grids import CLEAR_M, open_ground
from tests.unit.pdps.flight.flight_ticks import flying, view

NEAR = MissionConfig(max_distance_m=5.0)
LOW = MissionConfig(max_height_m=2.0)
LAG_S, TICK_S = 0.45, 0.05


def around(pose: Pose, speed: tuple[float, float]) -> Surroundings:
    edge = fence.edge(pose, NEAR)
    assert edge is not None
    near = Surroundings(velocity_frd_m_s=speed, lag_s=LAG_S)
    return replace(near, edge_frd=edge.towards_frd, edge_m=edge.away_m)


@settings(max_examples=20)
@given(
    st.floats(0, math.tau),
    st.floats(0, 4.8),
    st.floats(0, math.tau),
    st.floats(0.1, 2.0),
)
def test_no_course_leads_over_the_edge(
    bearing_rad: float, out_m: float, course_rad: float, speed_m_s: float
) -> None:
    """The drone follows each velocity 0.45 s late."""
    north_m, east_m = out_m * math.cos(bearing_rad), out_m * math.sin(bearing_rad)
    yaw_rad = 0.3
    wanted = Setpoint(speed_m_s * math.cos(course_rad), speed_m_s * math.sin(course_rad))
    late = [(0.0, 0.0)] * round(LAG_S / TICK_S)
    for _ in range(150):
        pose = Pose(0.0, north_m, east_m, -1.2, yaw_rad)
        safe = guarded(wanted, around(pose, late[0]), 0.3)
        late = [*late[1:], (safe.forward_m_s, safe.right_m_s)]
        velocity_n, velocity_e = frd_to_ned(*late[0], yaw_rad)
        north_m, east_m = north_m + TICK_S * velocity_n, east_m + TICK_S * velocity_e
        assert math.hypot(north_m, east_m) < 5.0


def test_a_drone_that_has_drifted_over_the_edge_returns() -> None:
    outside = Pose(0.0, 0.0, 5.5, -1.2, 0.0)
    safe = guarded(Setpoint(forward_m_s=0.5), around(outside, (0.0, 0.0)), 0.3)
    assert safe.right_m_s < -0.1
    assert safe.forward_m_s == pytest.approx(0.5)


def test_no_path_leads_near_the_edge_and_one_always_leads_back() -> None:
    ground = open_ground(reach_m=8.0)
    inside = fence.inside(ground, (0.0, 0.0), NEAR, CLEAR_M)
    ways = find_ways(find_ground(inside, (0.0, 0.0), CLEAR_M))
    assert ways.reaches((4.5, 0.0))
    assert not ways.reaches((5.0, 0.0))
    for out_m in (4.9, 5.3):
        drifted = (0.0, out_m)
        back = fence.inside(ground, drifted, NEAR, CLEAR_M)
        assert find_ways(find_ground(back, drifted, CLEAR_M)).reaches((0.0, 0.0))


def test_without_limits_nothing_changes() -> None:
    ground, plan = open_ground(), MissionConfig()
    assert fence.inside(ground, (0.0, 0.0), plan, CLEAR_M) is ground
    assert fence.edge(Pose(0.0, 1.0, 0.0, -1.0, 0.0), plan) is None
    assert fence.top_m(plan) == math.inf


@pytest.mark.parametrize(("height_m", "rises"), [(1.3, True), (1.69, False), (2.1, False)])
def test_the_drone_never_climbs_to_its_greatest_height(height_m: float, rises: bool) -> None:
    """A gust, a wrong estimate, a layer or a teammate may ask for more."""
    plan = LOW.model_copy(update={"height_m": 3.0})
    seen = view(height_m=height_m)
    _, action = step(flying(Phase.BUILDING), seen, plan)
    assert action.setpoint is not None
    assert (action.setpoint.down_m_s < -0.05) == rises


def test_a_scan_of_a_room_that_is_larger_than_the_fence_explores_what_is_within() -> None:
    for edge_m, phase in ((1.0, Phase.ROOM), (0.05, Phase.BUILDING)):
        seen = replace(view(), around=Surroundings(edge_m=edge_m))
        flight, _ = step(flying(Phase.ROOM), seen, NEAR)
        assert flight.phase is phase
        assert ("max_distance_m" in flight.notice) == (phase is Phase.BUILDING)


def test_a_layer_above_the_fence_is_not_flown() -> None:
    plan = MissionConfig(kind="layers", max_height_m=2.2)
    up = RangeReading(RangeState.DISTANCE, 5.0, 0.01)
    here = view(up=up, position=(0.0, 0.0)).observation
    back = Layers(LayersPhase.RETURN)
    climbing, _ = layering.step(back, here, open_ground(), plan)
    assert climbing.number == 1
    assert fits_above(math.inf, 0, plan)
    assert not fits_above(math.inf, 1, plan)
    assert not fits_above(5.0, 1, plan)


def test_a_drone_lets_nobody_pass_below_where_the_fence_leaves_no_room() -> None:
    pose = Pose(0.0, 0.0, 0.0, -1.2, 0.0)
    nothing = RangeReading(RangeState.NOTHING)
    assert passing_from(pose, nothing, 0.0, 1.2, 0.3)
    assert passing_from(pose, nothing, 0.0, 1.2, 0.3, top_m=1.9)
    assert passing_from(pose, nothing, 0.0, 1.2, 0.3, top_m=1.7) is None


def test_the_flight_knows_its_fence() -> None:
    app = App(Config(mission=NEAR))
    pose = Pose(0.0, 0.0, -3.0, -1.2, math.pi / 2)
    seen = app._around(pose)
    assert seen.edge_m == pytest.approx(2.0 - fence.BEFORE_M)
    assert seen.edge_frd == pytest.approx((-1.0, 0.0), abs=1e-9)


def test_a_mission_height_at_its_limit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"height_m = 1\.8: .* 0\.3 m below max_height_m = 2"):
        MissionConfig(height_m=1.8, max_height_m=2.0)
