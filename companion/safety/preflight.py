"""What is refused before the motors run, and what the pilot is told then."""

from companion.config.settings import MissionConfig
from companion.core.messages import VehicleState

MID_STICK = (
    "throttle stick to the middle before you switch the mode: with it low the drone sinks at once"
)
BATTERY_UNKNOWN = "the autopilot does not tell its battery: it will not turn back when that is low"


def refusal(vehicle: VehicleState, plan: MissionConfig) -> str:
    """Why this vehicle is not flown now, with what to do about it; or nothing."""
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
