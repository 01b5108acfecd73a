"""Tests that the mode switch has priority in every phase, and vehicles armed by others."""

from dataclasses import replace

import pytest

from companion.core.messages import CommandKind, Fault, LandedState, VehicleState
from companion.pdps.flight.phases import step
from companion.pdps.flight.state import FLYING_PHASES, NOTHING, FlightAction, FlightState, Phase
from companion.run.unattended import EXIT_ENDED, EXIT_FAILED, exit_status
from companion.safety import preflight
from tests.unit.pdps.flight.flight_ticks import FLYING, ON_GROUND, PLAN, asks, flying, view

GUIDED = replace(ON_GROUND, mode="GUIDED", in_offboard_mode=True)
LATE_S = 0.6
ASKING = replace(FlightState(Phase.OFFBOARD, since_s=99.0), mode_before="STABILIZE")
MODES = ("LOITER", "ALT_HOLD", "RTL", "LAND", "BRAKE", "POSCTL", "mode 27")


def after(phase: Phase, vehicle: VehicleState) -> tuple[FlightState, FlightAction]:
    flight = ASKING if phase is Phase.OFFBOARD else flying(phase)
    return step(flight, view(vehicle), PLAN)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("phase", [Phase.OFFBOARD, Phase.ARM, *sorted(FLYING_PHASES, key=str)])
def test_another_mode_hands_over_at_once(phase: Phase, mode: str) -> None:
    on_ground = phase in (Phase.OFFBOARD, Phase.ARM)
    before = ON_GROUND if on_ground else FLYING
    flight, action = after(phase, replace(before, mode=mode, in_offboard_mode=False))
    assert (flight.phase, action) == (Phase.HANDED_OVER, NOTHING)
    assert flight.trouble == f"mode changed to {mode}"
    assert exit_status(flight) == EXIT_ENDED


@pytest.mark.parametrize("phase", [Phase.ARM, Phase.ROOM, Phase.HOVER, Phase.HOLD, Phase.LAND])
def test_a_brief_mode_change_between_two_ticks_hands_over(phase: Phase) -> None:
    seen = replace(GUIDED if phase is Phase.ARM else FLYING, left_offboard=True)
    flight, action = after(phase, seen)
    assert (flight.phase, action) == (Phase.HANDED_OVER, NOTHING)


def test_the_mode_before_the_request_does_not_hand_over() -> None:
    flight, action = after(Phase.OFFBOARD, ON_GROUND)
    assert (flight.phase, asks(action)) == (Phase.OFFBOARD, CommandKind.OFFBOARD_MODE)


def test_the_drone_is_armed_only_in_the_requested_mode() -> None:
    flight, action = after(Phase.OFFBOARD, GUIDED)
    assert (flight.phase, asks(action)) == (Phase.ARM, CommandKind.ARM)
    flight, action = after(Phase.ARM, ON_GROUND)
    assert (flight.phase, action) == (Phase.HANDED_OVER, NOTHING)


@pytest.mark.parametrize(
    ("phase", "vehicle"),
    [
        (Phase.PREPARE, replace(ON_GROUND, armed=True)),
        (Phase.PREPARE, replace(GUIDED, armed=True)),
        (Phase.OFFBOARD, replace(ON_GROUND, armed=True)),
        (Phase.OFFBOARD, replace(GUIDED, armed=True)),
        (Phase.ARM, replace(GUIDED, armed=True, is_refused=True)),
    ],
)
def test_a_vehicle_armed_by_others_receives_no_command(phase: Phase, vehicle: VehicleState) -> None:
    flight, action = after(phase, vehicle)
    assert (flight.phase, action) == (Phase.FAILED, NOTHING)
    assert "disarm it" in flight.trouble
    assert exit_status(flight) == EXIT_ENDED  # otherwise a restart treats it as a crash


def test_a_vehicle_armed_by_our_command_is_flown_despite_an_earlier_refusal() -> None:
    flight, _ = after(Phase.ARM, replace(GUIDED, armed=True, refusal="ARM: FAILED"))
    assert flight.phase is Phase.TAKE_OFF


def test_a_landing_request_while_arming_prevents_arming() -> None:
    flight, action = step(flying(Phase.ARM), view(GUIDED, land_requested=True), PLAN)
    assert (flight.phase, action) == (Phase.FAILED, NOTHING)


# After the link was lost


@pytest.mark.parametrize(
    "vehicle", [replace(FLYING, mode_age_s=LATE_S), replace(FLYING, silent_s=5.0)]
)
def test_landing_is_not_commanded_while_the_mode_is_unknown(
    vehicle: VehicleState,
) -> None:
    flight, action = after(Phase.LAND, vehicle)
    assert (flight.phase, action) == (Phase.LAND, NOTHING)
    assert asks(step(flight, view(FLYING), PLAN)[1]) is CommandKind.LAND
    taken, action = step(flight, view(replace(FLYING, mode="LOITER", in_offboard_mode=False)), PLAN)
    assert (taken.phase, action) == (Phase.HANDED_OVER, NOTHING)


def test_a_persistent_fault_commands_no_landing_while_the_mode_is_unknown() -> None:
    silent = replace(FLYING, silent_s=5.0, mode_age_s=LATE_S)
    fault = Fault("the autopilot is silent", 3.0)
    held, _ = step(flying(Phase.ROOM), view(silent, fault=fault), PLAN)
    landing, action = step(held, view(silent, time_s=104.0, fault=fault), PLAN)
    assert (landing.phase, action) == (Phase.LAND, NOTHING)


@pytest.mark.parametrize(
    ("phase", "age_s", "asks_for"),
    [
        (Phase.OFFBOARD, 0.9, CommandKind.OFFBOARD_MODE),
        (Phase.OFFBOARD, 1.2, None),
        (Phase.ARM, 0.0, CommandKind.ARM),
        (Phase.ARM, 0.3, None),
    ],
)
def test_no_command_is_sent_before_the_next_heartbeat(
    phase: Phase, age_s: float, asks_for: CommandKind | None
) -> None:
    vehicle = ON_GROUND if phase is Phase.OFFBOARD else GUIDED
    flight, action = after(phase, replace(vehicle, mode_age_s=age_s))
    assert (flight.phase, asks(action)) == (phase, asks_for)


def test_the_flight_fails_if_only_the_mode_is_not_reported() -> None:
    flight, _ = after(Phase.ROOM, replace(FLYING, mode_age_s=11.0))
    assert (flight.phase, "HEARTBEAT" in flight.trouble) == (Phase.FAILED, True)
    assert exit_status(flight) == EXIT_FAILED


def test_a_drone_that_the_pilot_landed_is_not_disarmed() -> None:
    stands = replace(FLYING, mode="LAND", in_offboard_mode=False)
    stands = replace(stands, landed_state=LandedState.ON_GROUND)
    landing, _ = step(flying(Phase.LAND), view(stands), PLAN)
    taken, action = step(landing, view(replace(stands, mode="LOITER"), time_s=120.0), PLAN)
    assert (taken.phase, action) == (Phase.HANDED_OVER, NOTHING)


# Refusals before arming


@pytest.mark.parametrize("phase", [Phase.PREPARE, Phase.OFFBOARD, Phase.ARM])
@pytest.mark.parametrize(
    ("share", "home_percent", "land_percent", "key"),
    [
        (0.20, 20, 10, "mission.battery_home_percent = 20"),
        (0.03, 20, 10, "mission.battery_home_percent = 20"),
        (0.10, 0, 10, "mission.battery_land_percent = 10"),
        (0.21, 20, 10, ""),
        (None, 20, 10, ""),
    ],
)
def test_a_battery_below_the_limits_of_the_mission_prevents_take_off(
    phase: Phase, share: float | None, home_percent: float, land_percent: float, key: str
) -> None:
    plan = PLAN.model_copy(
        update={"battery_home_percent": home_percent, "battery_land_percent": land_percent}
    )
    vehicle = replace(GUIDED if phase is Phase.ARM else ON_GROUND, battery=share)
    flight, action = step(flying(phase), view(vehicle), plan)
    assert (flight.phase is Phase.FAILED) == bool(key)
    assert key in flight.trouble
    assert not key or (f"{100 * (share or 0):.0f} %" in flight.trouble and action == NOTHING)


def test_notices_name_the_throttle_and_an_unknown_battery() -> None:
    connected, _ = step(flying(Phase.CONNECT), view(ON_GROUND), PLAN)
    assert connected.notice == preflight.MID_STICK
    asking, _ = step(connected, view(ON_GROUND), PLAN)
    assert asking.notice == preflight.BATTERY_UNKNOWN
    known, _ = step(connected, view(replace(ON_GROUND, battery=0.9)), PLAN)
    assert known.notice == preflight.MID_STICK


# The take-off


def test_take_off_without_a_report_of_its_end_ends_after_a_time_at_height() -> None:
    rising = replace(FLYING, landed_state=LandedState.TAKING_OFF)
    flight = flying(Phase.TAKE_OFF)
    for time_s, phase in ((100.0, Phase.TAKE_OFF), (101.9, Phase.TAKE_OFF), (102.1, Phase.ROOM)):
        flight, _ = step(flight, view(rising, time_s=time_s), PLAN)
        assert flight.phase is phase


def test_a_drone_on_the_ground_with_a_wrong_height_does_not_begin_its_mission() -> None:
    stands = replace(FLYING, landed_state=LandedState.ON_GROUND)
    flight = flying(Phase.TAKE_OFF)
    for time_s in (100.0, 105.0):
        flight, _ = step(flight, view(stands, time_s=time_s), PLAN)
        assert flight.phase is Phase.TAKE_OFF
    flight, _ = step(flight, view(stands, time_s=120.0), PLAN)
    assert flight.phase is Phase.LAND
    assert flight.trouble == "at 1.2 m the autopilot still reports 'on ground' (EXTENDED_SYS_STATE)"


def test_a_refused_take_off_ends_with_the_autopilots_reason() -> None:
    stands = replace(GUIDED, armed=True, refusal="NAV_TAKEOFF: FAILED")
    flight, _ = step(flying(Phase.TAKE_OFF), view(stands, time_s=120.0, height_m=0.0), PLAN)
    assert flight.trouble == "still at 0.0 m: NAV_TAKEOFF: FAILED"


def test_the_missing_condition_is_reported_if_the_vehicle_is_not_ready() -> None:
    waits = replace(ON_GROUND, estimate_ready=False, waits_for="it does not tell (X)")
    flight, _ = step(flying(Phase.PREPARE), view(waits, time_s=160.0), PLAN)
    assert flight.trouble == "not ready after 60 s: it does not tell (X)"
