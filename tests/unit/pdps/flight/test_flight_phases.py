"""Tests of the transitions of the flight's diagram, and of the setpoints and commands sent."""

from dataclasses import replace

import numpy as np
import pytest

from companion.config.settings import MissionConfig
from companion.core.messages import (
    HOLD,
    CommandKind,
    LandedState,
    RangeReading,
    RangeState,
    VehicleState,
)
from companion.navigation.travel_state import Travel
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.flight.phases import step
from companion.pdps.flight.state import FlightAction, FlightState, Phase, TickInput
from companion.pdps.layers import Layers, LayersPhase
from companion.pdps.room_scan_state import RoomScan, ScanPhase
from companion.pdps.viewpoints import Viewpoint
from companion.safety.obstacle_memory import Surroundings
from tests.unit.pdps.flight.flight_ticks import (
    CLEAR,
    FLYING,
    ON_GROUND,
    PLAN,
    SILENT,
    SPACE,
    after,
    asks,
    flying,
    view,
)


def test_connect_waits_for_the_autopilot() -> None:
    assert after(Phase.CONNECT, view(VehicleState()))[0] is Phase.CONNECT
    assert after(Phase.CONNECT, view(ON_GROUND))[0] is Phase.PREPARE


def test_connect_timeout_starts_at_the_first_tick() -> None:
    flight, nobody = FlightState(), VehicleState()
    for waited_s, phase in ((0.0, Phase.CONNECT), (7.9, Phase.CONNECT), (8.1, Phase.FAILED)):
        flight, _ = step(flight, replace(view(nobody), time_s=500.0 + waited_s), PLAN)
        assert flight.phase is phase


def test_prepare_waits_for_gyro_and_estimate() -> None:
    assert after(Phase.PREPARE, view(ON_GROUND, gyro_at_rest=False))[0] is Phase.PREPARE
    no_estimate = replace(ON_GROUND, estimate_ready=False)
    assert after(Phase.PREPARE, view(no_estimate))[0] is Phase.PREPARE
    assert after(Phase.PREPARE, view(ON_GROUND))[0] is Phase.OFFBOARD


def test_prepare_waits_for_a_teammate_above_the_pad() -> None:
    seen = replace(view(ON_GROUND), around=Surroundings(is_column_free=False))
    assert after(Phase.PREPARE, seen)[0] is Phase.PREPARE
    late, _ = step(flying(Phase.PREPARE), replace(seen, time_s=1000.0), PLAN)
    assert late.phase is Phase.FAILED
    assert "a teammate flies above the pad" in late.trouble


def test_a_drone_climbs_on_the_spot_to_let_a_teammate_pass_and_comes_down_again() -> None:
    """Above the height of the mission it does not fly on, because lintels are not on the map."""
    home = flying(Phase.HOME)
    flight, action = step(home, replace(view(), around=Surroundings(lets_pass=True)), PLAN)
    assert flight.passing
    assert action.setpoint is not None
    assert action.setpoint.down_m_s < 0
    assert (action.setpoint.forward_m_s, action.setpoint.right_m_s) == (0.0, 0.0)
    high = view(height_m=PLAN.height_m + 0.75)
    flight, action = step(flight, high, PLAN)
    assert action.setpoint is not None
    assert action.setpoint.down_m_s > 0
    assert (action.setpoint.forward_m_s, action.setpoint.right_m_s) == (0.0, 0.0)
    flight, action = step(flight, view(), PLAN)
    assert not flight.passing


def test_a_drone_that_drifts_while_another_passes_returns_to_its_place() -> None:
    home = flying(Phase.HOME)
    flight, _ = step(home, replace(view(), around=Surroundings(lets_pass=True)), PLAN)
    drifted = view(height_m=PLAN.height_m + 0.4, position=(1.1, 0.8))
    _, action = step(flight, replace(drifted, around=Surroundings(lets_pass=True)), PLAN)
    assert action.setpoint is not None
    assert action.setpoint.forward_m_s < 0 < action.setpoint.right_m_s


def unheard(seen: TickInput) -> TickInput:
    """A tick in which a teammate with the right of way is not heard."""
    return replace(seen, observation=replace(seen.observation, waits_for_radio=True))


@pytest.mark.parametrize("phase", [Phase.ROOM, Phase.BUILDING])
def test_a_drone_that_does_not_hear_its_teammate_holds_its_place(phase: Phase) -> None:
    held, _ = step(flying(phase), unheard(view()), PLAN)
    assert "not heard" in held.activity
    drifted, action = step(held, unheard(view(time_s=130.0, position=(1.1, 0.8))), PLAN)
    assert action.setpoint is not None
    assert action.setpoint.forward_m_s < 0 < action.setpoint.right_m_s
    resumed, _ = step(drifted, view(time_s=160.0), PLAN)
    assert resumed.phase is phase
    assert "not heard" not in resumed.activity


def test_a_drone_on_its_way_home_waits_for_nobody() -> None:
    flight, _ = step(flying(Phase.HOME), unheard(view()), PLAN)
    assert "not heard" not in flight.activity


@pytest.mark.parametrize("phase", [Phase.BUILDING, Phase.HOME])
def test_a_drone_whose_map_contradicts_that_of_its_team_lands(phase: Phase) -> None:
    seen = view()
    seen = replace(seen, observation=replace(seen.observation, is_contradicted=True))
    flight, _ = step(flying(phase), seen, PLAN)
    assert flight.phase in (Phase.DIVERT, Phase.DESCEND, Phase.LAND)
    assert "on its own pad" in flight.trouble


def test_a_drone_that_is_not_home_in_time_lands_before_another_one_flies_on() -> None:
    seen = view()
    late_s = seen.time_s + 0.4 * PLAN.reserve_s
    late = replace(seen, observation=replace(seen.observation, home_by_s=late_s))
    flight, _ = step(flying(Phase.HOME), late, PLAN)
    assert flight.phase in (Phase.DIVERT, Phase.DESCEND, Phase.LAND)
    assert "not home" in flight.trouble


def test_a_pause_is_no_time_without_progress() -> None:
    """The drone is on its way to a viewpoint when it holds for a minute."""
    travel = Travel((3.0, 1.0), progress_s=99.0, progress_ne_m=(1.0, 1.0))
    explore = Explore(ExplorePhase.GO, travel=travel, look=Viewpoint((3.0, 1.0), ((4.0, 1.0),)))
    held, _ = step(replace(flying(Phase.BUILDING), building=explore), view(fault=SILENT), PLAN)
    resumed, _ = step(held, view(time_s=160.0), PLAN)
    assert resumed.building.travel is not None
    assert resumed.building.travel.progress_s is None


@pytest.mark.parametrize(
    "above", [RangeReading(RangeState.TOO_NEAR, 0.8), RangeReading(RangeState.DISTANCE, 1.1)]
)
def test_a_drone_below_a_lintel_does_not_climb_to_let_a_teammate_pass(above: RangeReading) -> None:
    seen = replace(view(up=above), around=Surroundings(lets_pass=True))
    flight, action = step(flying(Phase.HOME), seen, PLAN)
    assert not flight.passing
    assert action.setpoint is not None
    assert action.setpoint.down_m_s == pytest.approx(0.0)


def test_a_drone_beside_a_lintel_or_in_a_doorway_does_not_climb() -> None:
    beside = replace(view(), around=Surroundings(lets_pass=True, may_climb=False))
    assert not step(flying(Phase.HOME), beside, PLAN)[0].passing
    jambs = SPACE.with_obstacles(np.array([(1.0, 0.5), (1.0, 1.5)]))
    between = replace(view(), around=Surroundings(lets_pass=True), space=jambs)
    assert not step(flying(Phase.HOME), between, PLAN)[0].passing


def test_a_climb_ends_below_a_lintel_that_was_measured_on_the_way() -> None:
    """The lintel then comes nearer than the sensor measures, and reads as if it were far away."""
    let_pass = Surroundings(lets_pass=True)
    flight, _ = step(flying(Phase.HOME), replace(view(), around=let_pass), PLAN)
    near = view(up=RangeReading(RangeState.TOO_NEAR, 0.6), height_m=PLAN.height_m + 0.2)
    flight, _ = step(flight, replace(near, around=let_pass), PLAN)
    folded = view(up=RangeReading(RangeState.DISTANCE, 1.3), height_m=PLAN.height_m + 0.45)
    _, action = step(flight, replace(folded, around=let_pass), PLAN)
    assert action.setpoint is not None
    assert action.setpoint.down_m_s >= 0


def test_a_drone_that_lets_nobody_pass_flies_on_at_any_height() -> None:
    flight = replace(flying(Phase.BUILDING), building=Explore(here_ne_m=(0.0, 0.0)))
    flight, action = step(flight, view(height_m=PLAN.height_m + 0.5), PLAN)
    assert action.setpoint is not None
    assert np.hypot(action.setpoint.forward_m_s, action.setpoint.right_m_s) > 0.1


def test_a_drone_does_not_climb_or_descend_to_a_teammate() -> None:
    held = Surroundings(climb_limits_m_s=(0.0, 0.0))
    for height_m in (PLAN.height_m - 0.5, PLAN.height_m + 0.1):
        seen = replace(view(height_m=height_m), around=held)
        _, action = step(flying(Phase.HOME), seen, PLAN)
        assert action.setpoint is not None
        assert action.setpoint.down_m_s == 0.0


def test_the_flight_requests_the_mode_then_arms_then_takes_off() -> None:
    phase, action = after(Phase.OFFBOARD, view(ON_GROUND))
    assert (phase, asks(action)) == (Phase.OFFBOARD, CommandKind.OFFBOARD_MODE)
    guided = replace(ON_GROUND, mode="GUIDED", in_offboard_mode=True)
    assert after(Phase.OFFBOARD, view(guided))[0] is Phase.ARM
    phase, action = after(Phase.ARM, view(guided))
    assert (phase, asks(action)) == (Phase.ARM, CommandKind.ARM)
    armed = replace(guided, armed=True)
    assert after(Phase.ARM, view(armed))[0] is Phase.TAKE_OFF
    phase, action = after(Phase.TAKE_OFF, view(armed, height_m=0.0))
    assert (phase, asks(action)) == (Phase.TAKE_OFF, CommandKind.TAKE_OFF)


def test_no_setpoint_is_sent_during_the_climb() -> None:
    climbing = replace(FLYING, landed_state=LandedState.TAKING_OFF)
    assert after(Phase.TAKE_OFF, view(climbing, height_m=0.5)) == (Phase.TAKE_OFF, FlightAction())


def test_px4_takes_off_by_an_upward_setpoint() -> None:
    px4 = replace(FLYING, takes_off_by_setpoint=True, landed_state=LandedState.ON_GROUND)
    phase, action = after(Phase.TAKE_OFF, view(px4, height_m=0.0))
    assert phase is Phase.TAKE_OFF
    assert action.command is None
    assert action.setpoint is not None
    assert action.setpoint.down_m_s < 0


def test_setpoints_before_take_off_have_zero_velocity() -> None:
    for phase in (Phase.OFFBOARD, Phase.ARM):
        guided = replace(ON_GROUND, in_offboard_mode=phase is Phase.ARM)
        assert after(phase, view(guided))[1].setpoint == HOLD


def test_the_room_scan_begins_at_mission_height() -> None:
    phase, action = after(Phase.TAKE_OFF, view())
    assert (phase, action.setpoint) == (Phase.ROOM, HOLD)


def test_the_flight_is_done_when_landed_and_disarmed() -> None:
    phase, action = after(Phase.LAND, view())
    assert (phase, asks(action)) == (Phase.LAND, CommandKind.LAND)
    landed = replace(ON_GROUND, mode="LAND")
    flight, action = step(flying(Phase.LAND), view(landed), PLAN)
    assert (flight.phase, flight.completed, action) == (Phase.DONE, True, FlightAction())


@pytest.mark.parametrize("phase", [Phase.TAKE_OFF, Phase.ROOM, Phase.HOME, Phase.HOLD])
def test_a_mode_change_by_the_pilot_hands_over_at_once(phase: Phase) -> None:
    loiter = replace(FLYING, mode="LOITER", in_offboard_mode=False)
    flight, action = step(flying(phase), view(loiter), PLAN)
    assert (flight.phase, action) == (Phase.HANDED_OVER, FlightAction())
    assert flight.trouble == "mode changed to LOITER"
    again, action = step(flight, view(), PLAN)
    assert (again, action) == (flight, FlightAction())


def test_a_mode_change_during_landing_hands_over() -> None:
    landing, _ = step(flying(Phase.LAND), view(replace(FLYING, mode="LAND")), PLAN)
    taken, action = step(landing, view(replace(FLYING, mode="LOITER")), PLAN)
    assert (taken.phase, action) == (Phase.HANDED_OVER, FlightAction())


def test_late_setpoints_are_reported_as_the_reason_of_a_landing_by_the_autopilot() -> None:
    late = replace(view(replace(FLYING, mode="LAND", in_offboard_mode=False)), starved="ticks late")
    taken, _ = step(flying(Phase.ROOM), late, PLAN)
    assert taken.ending == "handed over: mode changed to LAND; ticks late"


def test_the_flight_fails_if_the_drone_is_disarmed_in_the_air() -> None:
    flight, _ = step(flying(Phase.ROOM), view(replace(FLYING, armed=False)), PLAN)
    assert (flight.phase, flight.completed) == (Phase.FAILED, False)


def test_the_drone_holds_during_a_fault_and_continues_after_it() -> None:
    held, action = step(flying(Phase.ROOM), view(fault=SILENT), PLAN)
    assert (held.phase, held.trouble, action) == (Phase.HOLD, SILENT.text, FlightAction(HOLD))
    resumed, _ = step(held, view(time_s=100.5), PLAN)
    assert (resumed.phase, resumed.trouble) == (Phase.ROOM, "")


def test_the_drone_lands_if_a_fault_persists() -> None:
    held, _ = step(flying(Phase.ROOM), view(fault=SILENT), PLAN)
    waiting, action = step(held, view(time_s=100.9, fault=SILENT), PLAN)
    assert (waiting.phase, action) == (Phase.HOLD, FlightAction(HOLD))
    landing, action = step(held, view(time_s=101.1, fault=SILENT), PLAN)
    assert (landing.phase, asks(action)) == (Phase.LAND, CommandKind.LAND)
    landed, _ = step(landing, view(ON_GROUND, time_s=110.0), PLAN)
    assert landed.phase is Phase.DONE
    assert not landed.completed


def test_a_fault_does_not_replace_the_reason_for_the_return() -> None:
    going = replace(flying(Phase.HOME), trouble="turned back for the limit of 600 s")
    held, _ = step(going, view(fault=SILENT), PLAN)
    resumed, _ = step(held, view(time_s=100.5), PLAN)
    assert resumed.trouble == going.trouble


def test_an_autopilot_on_the_ground_that_stays_armed_is_commanded_to_disarm() -> None:
    stands = replace(FLYING, mode="LAND", landed_state=LandedState.ON_GROUND)
    assert asks(after(Phase.LAND, view(stands))[1]) is None
    assert asks(after(Phase.LAND, view(stands, time_s=110.0))[1]) is CommandKind.DISARM
    sinking = replace(stands, landed_state=LandedState.LANDING)
    assert asks(after(Phase.LAND, view(sinking, time_s=110.0))[1]) is None


def test_the_flight_fails_after_ten_seconds_without_messages() -> None:
    silent = replace(FLYING, silent_s=11.0)
    for phase in (Phase.ROOM, Phase.LAND):
        assert after(phase, view(silent))[0] is Phase.FAILED


def test_refused_arming_ends_with_the_autopilots_reason() -> None:
    refusing = replace(ON_GROUND, mode="GUIDED", in_offboard_mode=True, refusal="ARM: no compass")
    flight, _ = step(flying(Phase.ARM), view(refusing, time_s=140.0), PLAN)
    assert flight.phase is Phase.FAILED
    assert "no compass" in flight.trouble


def test_the_flight_fails_without_a_command_if_the_vehicle_is_already_armed() -> None:
    phase, action = after(Phase.PREPARE, view(FLYING))
    assert (phase, action) == (Phase.FAILED, FlightAction())


def test_each_mission_begins_in_its_own_phase() -> None:
    begun = {
        kind: step(flying(Phase.TAKE_OFF), view(), MissionConfig.model_validate({"kind": kind}))[0]
        for kind in ("room", "building", "exterior", "layers")
    }
    assert {kind: flight.phase for kind, flight in begun.items()} == {
        "room": Phase.ROOM,
        "building": Phase.BUILDING,
        "exterior": Phase.BUILDING,
        "layers": Phase.LAYERS,
    }


def test_a_blocked_room_scan_changes_to_exploration() -> None:
    blocked = replace(flying(Phase.ROOM), room=RoomScan(ScanPhase.BLOCKED))
    assert step(blocked, view(), PLAN)[0].phase is Phase.BUILDING


def test_the_drone_flies_home_when_exploration_is_done() -> None:
    seen = replace(flying(Phase.BUILDING), building=Explore(ExplorePhase.DONE))
    assert step(seen, view(), PLAN)[0].phase is Phase.HOME
    layers = replace(flying(Phase.LAYERS), layers=Layers(LayersPhase.DONE))
    assert step(layers, view(), PLAN)[0].phase is Phase.HOME


@pytest.mark.parametrize("phase", [Phase.ROOM, Phase.BUILDING, Phase.LAYERS, Phase.HOME])
def test_height_is_held(phase: Phase) -> None:
    _, low = after(phase, view(height_m=PLAN.height_m - 0.3, up=CLEAR))
    _, high = after(phase, view(height_m=PLAN.height_m + 0.3, up=CLEAR))
    assert low.setpoint is not None
    assert high.setpoint is not None
    assert low.setpoint.down_m_s < 0 < high.setpoint.down_m_s


def test_the_drone_does_not_climb_towards_a_near_ceiling() -> None:
    ceiling = RangeReading(RangeState.DISTANCE, 0.5, 0.01)
    _, action = after(Phase.ROOM, view(height_m=PLAN.height_m - 0.3, up=ceiling))
    assert action.setpoint is not None
    assert action.setpoint.down_m_s == 0


def test_near_obstacles_limit_the_velocity() -> None:
    wall = np.array([(0.52, 0.05 * i) for i in range(-8, 9)])
    going = replace(flying(Phase.HOME), way_home=Travel((3.0, 1.0)))
    _, free = step(going, view(), PLAN)
    _, guarded = step(going, replace(view(), around=Surroundings(wall)), PLAN)
    assert free.setpoint is not None
    assert guarded.setpoint is not None
    assert guarded.setpoint.forward_m_s < 0.2 < free.setpoint.forward_m_s
