"""Tests with MAVSDK as client: it flies the simulated vehicle on both firmwares."""

from collections.abc import Iterator

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action, ActionError
from mavsdk.plugins.offboard import Offboard, VelocityBodyYawspeed
from mavsdk.plugins.telemetry import Telemetry

from tests.processes.started import free_udp_port, vehicle_at
from tests.waiting import DEADLINE_S, PAUSE, until


@pytest.fixture(params=["ardupilot", "px4"])
def vehicle(request: pytest.FixtureRequest) -> Iterator[tuple[Action, Offboard, Telemetry]]:
    """Plugins of a ground station that has detected the vehicle."""
    port = free_udp_port()
    station = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        with vehicle_at(port, request.param):
            station.add_any_connection(f"udpin://127.0.0.1:{port}")
            system = station.first_autopilot(DEADLINE_S)
            assert system is not None
            telemetry = Telemetry(system)
            for rate in ("health", "in_air", "landed_state", "position_velocity_ned"):
                getattr(telemetry, f"set_rate_{rate}")(10.0)
            yield Action(system), Offboard(system), telemetry
    finally:
        station.destroy()


def origin_is_taken(action: Action) -> bool:
    """The origin is ignored until the estimator has settled."""
    try:
        action.set_gps_global_origin(47.0, 8.0, 400.0)
    except ActionError:
        return False
    return True


def test_mavsdk_connects_arms_takes_off_flies_and_lands(
    vehicle: tuple[Action, Offboard, Telemetry],
) -> None:
    action, offboard, telemetry = vehicle
    until(lambda: origin_is_taken(action), "origin")
    until(lambda: telemetry.health().is_local_position_ok, "local position")
    until(lambda: telemetry.health().is_armable, "armable")

    def height_m() -> float:
        return -float(telemetry.position_velocity_ned().position.down_m)

    action.set_takeoff_altitude(1.5)
    action.arm()
    action.takeoff()
    until(lambda: height_m() > 1.3, "height")
    until(lambda: bool(telemetry.in_air()), "in the air")

    offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 0.0))
    PAUSE.wait(1.5)  # PX4 requires a stream before the mode
    offboard.start()
    offboard.set_velocity_body(VelocityBodyYawspeed(0.4, 0.0, 0.0, 0.0))

    def speed_m_s() -> float:
        velocity = telemetry.position_velocity_ned().velocity
        return float((velocity.north_m_s**2 + velocity.east_m_s**2) ** 0.5)

    until(lambda: speed_m_s() > 0.3, "speed")
    assert offboard.is_active()
    action.land()
    until(lambda: not telemetry.armed(), "disarmed")


def test_arming_before_readiness_is_refused_with_the_reason(
    vehicle: tuple[Action, Offboard, Telemetry],
) -> None:
    action, _, telemetry = vehicle

    def reports_why() -> bool:
        """PX4 sends texts only to links with a recent ground station's heartbeat."""
        with pytest.raises(ActionError):
            action.arm()
        return "AHRS" in telemetry.status_text().text

    until(reports_why, "the reason")
