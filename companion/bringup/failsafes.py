"""Reads from the autopilot's parameters what happens when the pilot's transmitter is lost.

The meanings of the values are those of ArduCopter 4.6.3 and PX4 1.17, from their sources.
"""

from collections.abc import Mapping

from companion.bringup.findings import CheckResult, Finding
from companion.link.firmware import ArduPilot, Firmware, Px4

PART = "transmitter loss"
"""Name of the part in the results."""
NEEDED = {
    ArduPilot.autopilot: ("FS_THR_ENABLE", "FS_OPTIONS", "RTL_ALT"),
    Px4.autopilot: ("COM_RC_IN_MODE", "COM_RCL_EXCEPT", "NAV_RCL_ACT", "RTL_RETURN_ALT"),
}
"""Parameters that decide on it, by HEARTBEAT.autopilot."""
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
    return NEEDED[firmware.autopilot]


def transmitter_loss(firmware: Firmware, values: Mapping[str, float]) -> Finding | None:
    """What the autopilot does without the transmitter; None before all parameters are known."""
    if not all(name in values for name in needed_parameters(firmware)):
        return None
    judge = _by_ardupilot if firmware.autopilot == ArduPilot.autopilot else _by_px4
    return judge({name: int(value) for name, value in values.items()})


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
