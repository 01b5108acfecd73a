"""Faults of the autopilot, and actions of the pilot."""

import math
from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.firmware import ARDUCOPTER_MODES, PX4_MODES
from sitl.autopilot.firmware import Throttle
from sitl.core.errors import SitlError
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.action import Action


def crash(reason: str = "test") -> Action:
    """The autopilot disarms as after a collision."""
    return Action(lambda simulation: simulation.autopilot.crash(reason))


def restart_autopilot() -> Action:
    """The autopilot reboots: silent for 1.5 s, motors off, then in its boot mode."""
    return Action(lambda simulation: simulation.autopilot.restart())


def jump_clock(seconds: float) -> Action:
    """The autopilot's time since boot jumps forward or back."""
    return Action(lambda simulation: simulation.autopilot.jump_clock(seconds))


def jump_odometry(
    north_m: float = 0.0, east_m: float = 0.0, down_m: float = 0.0, yaw_deg: float = 0.0
) -> Action:
    """The autopilot's estimate jumps."""
    yaw_rad = math.radians(yaw_deg)
    return Action(
        lambda simulation: simulation.autopilot.estimate.jump(north_m, east_m, down_m, yaw_rad)
    )


def lose_flow(for_s: float | None = None) -> Action:
    """The floor has no texture: the autopilot loses its position and lands after some seconds."""
    return Action(
        lambda simulation: simulation.autopilot.lose_flow(lost=True),
        lambda simulation: simulation.autopilot.lose_flow(lost=False),
        for_s,
    )


def battery(percent: float) -> Action:
    """Set the remaining charge."""
    return Action(lambda simulation: simulation.autopilot.set_battery(percent / 100))


def refuse_arming(for_s: float | None = None) -> Action:
    """The autopilot's own checks reject arming."""
    return Action(
        lambda simulation: simulation.autopilot.refuse_arming(refuse=True),
        lambda simulation: simulation.autopilot.refuse_arming(refuse=False),
        for_s,
    )


MODE_NAMES = {"ardupilot": ARDUCOPTER_MODES, "px4": PX4_MODES}
"""Names of modes by custom_mode, for each firmware."""


class ModeError(SitlError, ValueError):
    """The autopilot has no such mode; the text lists its modes."""


def pilot_mode(name: str, throttle: str = "low") -> Action:
    """Set the pilot's mode switch: "LOITER", "LAND", PX4's "POSCTL" and so on.

    Unless the throttle stick is at its middle, "mid", the drone sinks or falls in every manual
    mode.

    Raises:
        ModeError: neither autopilot has the mode, or, during the flight, this one has not.
    """
    stick = Throttle(_one_of(list(Throttle), throttle, "throttle"))
    _one_of(sorted({m for modes in MODE_NAMES.values() for m in modes.values()}), name, "mode")

    def switch(simulation: Simulation) -> None:
        autopilot = simulation.autopilot
        numbers = {mode: number for number, mode in MODE_NAMES[autopilot.kind].items()}
        _one_of(list(numbers), name, f"{autopilot.kind} mode")
        autopilot.pilot_mode(numbers[name], stick)

    return Action(switch)


def _one_of(known: Sequence[str], given: str, what: str) -> str:
    if given not in known:
        raise ModeError(f"no {what} {given!r}; known: {', '.join(known)}")
    return given


def pilot_arms() -> Action:
    """The pilot or a ground station arms the vehicle."""
    return Action(lambda simulation: simulation.autopilot.pilot_arms())


def mute(message: str, for_s: float | None = None) -> Action:
    """The autopilot stops sending a message, such as "EXTENDED_SYS_STATE"."""
    return Action(
        lambda simulation: simulation.autopilot.mute.add(message),
        lambda simulation: simulation.autopilot.mute.discard(message),
        for_s,
    )


def stay_taking_off(for_s: float | None = None) -> Action:
    """The autopilot reports "taking off" during the whole flight."""
    return Action(
        lambda simulation: simulation.autopilot.stay_taking_off(stays=True),
        lambda simulation: simulation.autopilot.stay_taking_off(stays=False),
        for_s,
    )


def claim(vehicle: str | None = None, autopilot: str | None = None) -> Action:
    """HEARTBEATs contain another MAV_TYPE, such as "GROUND_ROVER", or MAV_AUTOPILOT, "GENERIC"."""
    claimed = _number("MAV_TYPE", vehicle), _number("MAV_AUTOPILOT", autopilot)
    return Action(lambda simulation: simulation.autopilot.claim(*claimed))


def _number(enum: str, name: str | None) -> int | None:
    if name is None:
        return None
    numbers: dict[str, int] = {
        entry.name.removeprefix(f"{enum}_"): number for number, entry in mavlink.enums[enum].items()
    }
    return numbers[_one_of(list(numbers), name, enum)]
