"""Compares the autopilot's own fence with the limits of the mission.

The meanings of the parameters are those of ArduCopter 4.6.3 and PX4 1.17, from their sources.
"""

import math
from collections.abc import Mapping

from companion.bringup.findings import CheckResult, Finding
from companion.config.settings import MissionConfig
from companion.link.firmware import ArduPilot, Firmware, Px4

PART = "fence"
"""Name of the part in the results."""
ARDUPILOT = (
    *("FENCE_ENABLE", "FENCE_TYPE", "FENCE_ACTION"),
    *("FENCE_ALT_MAX", "FENCE_RADIUS", "FENCE_MARGIN"),
)
PX4 = ("GF_ACTION", "GF_MAX_VER_DIST", "GF_MAX_HOR_DIST")
"""Parameters of the fence of each autopilot."""
SAFE_ACTIONS = {"FENCE_ACTION": (0, 2, 4), "GF_ACTION": (0, 1, 2, 5)}
"""Reactions that neither climb, as a return does, nor stop the motors in the air."""
REMEDY = "link.set_fence = true writes one that fits"
"""Remedy of all faults."""


def fence_parameters(firmware: Firmware) -> tuple[str, ...]:
    """Names of the parameters that `fence_beside` reads."""
    return {ArduPilot.autopilot: ARDUPILOT, Px4.autopilot: PX4}[firmware.autopilot]


def is_limited(plan: MissionConfig) -> bool:
    """True if the mission has limits for a fence."""
    return plan.max_height_m is not None or plan.max_distance_m is not None


def fence_beside(
    firmware: Firmware, values: Mapping[str, float], plan: MissionConfig
) -> Finding | None:
    """The autopilot's fence beside the limits of the mission; None without, or before it is known.

    A fence nearer than the limits would end the mission.
    """
    limits = {"max_height_m": plan.max_height_m, "max_distance_m": plan.max_distance_m}
    names = fence_parameters(firmware)
    if not is_limited(plan) or not all(name in values for name in names):
        return None
    is_ardupilot = firmware.autopilot == ArduPilot.autopilot
    reach_m = dict(zip(limits, (_ardupilot_m if is_ardupilot else _px4_m)(values), strict=True))
    wanted = {key: limit for key, limit in limits.items() if limit is not None}
    for key, limit_m in wanted.items():
        if reach_m[key] < limit_m - 1e-6:
            seen = f"the autopilot stops at {reach_m[key]:g} m, and mission.{key} = {limit_m:g}"
            return Finding(PART, CheckResult.BAD, seen, REMEDY)
    if all(math.isinf(reach_m[key]) for key in wanted):
        return Finding(
            PART, CheckResult.GOOD, "the companion's only; the autopilot's is off", REMEDY
        )
    action = "FENCE_ACTION" if is_ardupilot else "GF_ACTION"
    if values[action] not in SAFE_ACTIONS[action]:
        seen = f"{action} {values[action]:g} returns, and climbs first, or stops the motors"
        return Finding(PART, CheckResult.BAD, seen, REMEDY)
    told = ", ".join(f"{key} {reach_m[key]:g} m" for key in wanted)
    return Finding(PART, CheckResult.GOOD, f"the autopilot's, for {told}")


def _ardupilot_m(values: Mapping[str, float]) -> tuple[float, float]:
    """Height and distance to which the autopilot lets the drone fly, m; infinite without a fence.

    ArduPilot's avoidance stops the drone `FENCE_MARGIN` before the fence.
    """
    types = int(values["FENCE_TYPE"]) if values["FENCE_ENABLE"] else 0
    margin_m = values["FENCE_MARGIN"]
    has_height, has_circle = types & ArduPilot.FENCE_HEIGHT, types & ArduPilot.FENCE_CIRCLE
    return (
        values["FENCE_ALT_MAX"] - margin_m if has_height else math.inf,
        values["FENCE_RADIUS"] - margin_m if has_circle else math.inf,
    )


def _px4_m(values: Mapping[str, float]) -> tuple[float, float]:
    """As above, of PX4, where 0 is no limit."""
    return values["GF_MAX_VER_DIST"] or math.inf, values["GF_MAX_HOR_DIST"] or math.inf
