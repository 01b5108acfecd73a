"""Checks the vehicle before arming, and defines the messages to the pilot."""

from companion.config.settings import MissionConfig
from companion.core.messages import VehicleState

MID_STICK = (
    "throttle stick to the middle before you switch the mode: with it low the drone sinks at once"
)
"""Advice before the pilot switches to offboard control."""
BATTERY_UNKNOWN = (
    "the autopilot does not report its battery: the drone will not return when it is low"
)
"""Warning if the autopilot reports no battery level."""


def refusal(vehicle: VehicleState, plan: MissionConfig) -> str:
    """Return the reason why the vehicle must not fly and its remedy; empty if it may fly."""
    if vehicle.unfit or vehicle.battery is None:
        return vehicle.unfit
    percent = 100 * vehicle.battery
    least_percent, key = max(
        (plan.battery_home_percent, "battery_home_percent"),
        (plan.battery_land_percent, "battery_land_percent"),
    )
    if percent > least_percent:
        return ""
    return (
        f"{percent:.0f} % of the battery is left, and with mission.{key} = {least_percent:g} the "
        "flight would end at once: charge it"
    )
