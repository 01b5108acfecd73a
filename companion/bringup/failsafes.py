"""Reads from the autopilot's parameters what its failsafe for the transmitter and its fence do.

The meanings of the values are those of ArduCopter 4.6.3 and PX4 1.17, from their sources.
"""

import math
from collections.abc import Mapping

from companion.bringup.findings import CheckResult, Finding
from companion.config.settings import MissionConfig
from companion.link.firmware import ArduPilot, Firmware

PART = "transmitter loss"
"""Name of the part in the results."""
NEEDED = {
    True: ("FS_THR_ENABLE", "FS_OPTIONS", "RTL_ALT"),
    False: ("COM_RC_IN_MODE", "COM_RCL_EXCEPT", "NAV_RCL_ACT", "RTL_RETURN_ALT"),
}
"""Parameters of ArduPilot (True) and of PX4."""
CONTINUE_IN_GUIDED = 1 << 2
"""Bit of ArduPilot's FS_OPTIONS."""
OFFBOARD_EXCEPTED = 1 << 2
"""Bit of PX4's COM_RCL_EXCEPT."""
NO_STICKS = 4
"""Value of PX4's COM_RC_IN_MODE: sticks and switches are ignored."""
ARDUPILOT_LANDS, PX4_LANDS = {3: "lands", 7: "brakes or lands"}, {1: "holds", 3: "lands"}
"""Reactions by FS_THR_ENABLE and NAV_RCL_ACT without a climb."""
PX4_FALLS = (5, 6)
"""Values of NAV_RCL_ACT that stop the motors."""
IGNORED = "it is ignored in flight: nobody can stop the drone then"
"""Text if the autopilot flies on."""


def needed_parameters(firmware: Firmware) -> tuple[str, ...]:
    """Names of the parameters that `transmitter_loss` reads."""
    return NEEDED[isinstance(firmware, ArduPilot)]


def transmitter_loss(firmware: Firmware, values: Mapping[str, float]) -> Finding | None:
    """What the autopilot does without the transmitter; None before all parameters are known."""
    if not all(name in values for name in needed_parameters(firmware)):
        return None
    judge = _by_ardupilot if isinstance(firmware, ArduPilot) else _by_px4
    return judge({name: int(value) for name, value in values.items()})


FENCE = {
    True: ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_ACTION", "FENCE_MARGIN"),
    False: ("GF_ACTION", "GF_MAX_VER_DIST", "GF_MAX_HOR_DIST"),
}
"""Parameters of the fence of ArduPilot (True) and of PX4."""
FENCE_LIMITS = ("FENCE_ALT_MAX", "FENCE_RADIUS")
"""ArduPilot's limits of the fence, m, in the order of the bits of FENCE_TYPE."""
FENCE_ACTIONS = {True: (0, 2, 4), False: (0, 1, 2, 5)}
"""Values of FENCE_ACTION and GF_ACTION that neither climb nor stop the motors."""
SET_FENCE = "link.set_fence = true writes one that fits"
"""Remedy of all faults of the fence."""


def fence_parameters(firmware: Firmware) -> tuple[str, ...]:
    """Names of the parameters that `fence_of` reads."""
    is_ardupilot = isinstance(firmware, ArduPilot)
    return (*FENCE[is_ardupilot], *(FENCE_LIMITS if is_ardupilot else ()))


def fence_of(
    firmware: Firmware, values: Mapping[str, float], plan: MissionConfig
) -> Finding | None:
    """The autopilot's fence beside the limits of the mission; None without, or before it is known.

    A fence nearer than the limits would end the mission, and ArduPilot's avoidance stops the drone
    a margin before it.
    """
    limits = {"max_height_m": plan.max_height_m, "max_distance_m": plan.max_distance_m}
    wanted = {key: limit for key, limit in limits.items() if limit is not None}
    if not wanted or not all(name in values for name in fence_parameters(firmware)):
        return None
    is_ardupilot = isinstance(firmware, ArduPilot)
    there = dict(zip(limits, _fence_m(values, is_ardupilot=is_ardupilot), strict=True))
    action = int(values["FENCE_ACTION" if is_ardupilot else "GF_ACTION"])
    for key, limit_m in wanted.items():
        if there[key] < limit_m - 1e-6:
            seen = f"the autopilot stops at {there[key]:g} m, and mission.{key} = {limit_m:g}"
            return Finding("fence", CheckResult.BAD, seen, SET_FENCE)
    if all(math.isinf(there[key]) for key in wanted):
        seen = "only the companion's: the autopilot has none"
        return Finding("fence", CheckResult.GOOD, seen, SET_FENCE)
    if action not in FENCE_ACTIONS[is_ardupilot]:
        seen = f"at its fence the autopilot returns, which climbs, or stops the motors ({action})"
        return Finding("fence", CheckResult.BAD, seen, SET_FENCE)
    told = ", ".join(f"{key} {there[key]:g} m" for key in wanted)
    return Finding("fence", CheckResult.GOOD, f"the autopilot's, for {told}")


def _fence_m(values: Mapping[str, float], *, is_ardupilot: bool) -> tuple[float, float]:
    """Height and distance to which the autopilot lets the drone fly, m; infinite if to any."""
    if not is_ardupilot:
        height_m, distance_m = values["GF_MAX_VER_DIST"], values["GF_MAX_HOR_DIST"]
        return height_m or math.inf, distance_m or math.inf
    types = int(values["FENCE_TYPE"]) if values["FENCE_ENABLE"] else 0
    bits = (ArduPilot.FENCE_HEIGHT, ArduPilot.FENCE_CIRCLE)
    height_m, distance_m = (
        values[name] - values["FENCE_MARGIN"] if types & bit else math.inf
        for name, bit in zip(FENCE_LIMITS, bits, strict=True)
    )
    return height_m, distance_m


def _by_ardupilot(values: Mapping[str, int]) -> Finding:
    action = values["FS_THR_ENABLE"]
    if action == 0:
        return _bad(IGNORED, "set FS_THR_ENABLE to 3 (FS_THR_ENABLE = 0)")
    if values["FS_OPTIONS"] & CONTINUE_IN_GUIDED:
        return _bad(IGNORED, f"clear bit 2 of FS_OPTIONS (FS_OPTIONS = {values['FS_OPTIONS']})")
    if action in ARDUPILOT_LANDS:
        return Finding(
            PART, CheckResult.GOOD, f"{ARDUPILOT_LANDS[action]} (FS_THR_ENABLE {action})"
        )
    height_m = values["RTL_ALT"] / 100
    return _bad(
        f"it returns, and first climbs to {height_m:g} m (FS_THR_ENABLE {action}, RTL_ALT)",
        "set FS_THR_ENABLE to 3, which lands",
    )


def _by_px4(values: Mapping[str, int]) -> Finding:
    action = values["NAV_RCL_ACT"]
    if values["COM_RC_IN_MODE"] == NO_STICKS:
        return _bad(IGNORED, "set COM_RC_IN_MODE to 0 (COM_RC_IN_MODE = 4 ignores all sticks)")
    if values["COM_RCL_EXCEPT"] & OFFBOARD_EXCEPTED:
        return _bad(
            IGNORED, f"set COM_RCL_EXCEPT to 0 (COM_RCL_EXCEPT = {values['COM_RCL_EXCEPT']})"
        )
    if action in PX4_LANDS:
        return _good(f"{PX4_LANDS[action]} (NAV_RCL_ACT {action})")
    if action in PX4_FALLS:
        return _bad(f"it falls (NAV_RCL_ACT {action})", "set NAV_RCL_ACT to 3, which lands")
    height_m = values["RTL_RETURN_ALT"]
    return _bad(
        f"it returns, and first climbs to {height_m:g} m (NAV_RCL_ACT {action}, RTL_RETURN_ALT)",
        "set NAV_RCL_ACT to 3, which lands",
    )


def _good(seen: str) -> Finding:
    return Finding(PART, CheckResult.GOOD, seen)


def _bad(seen: str, remedy: str) -> Finding:
    return Finding(PART, CheckResult.BAD, seen, f"{remedy}; deploy/ has parameters that land")
