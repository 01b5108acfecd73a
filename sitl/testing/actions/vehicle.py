"""Faults of the autopilot, and what a pilot does."""

import math
from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.firmware import ARDUCOPTER_MODES, PX4_MODES
from sitl.autopilot.firmware import Throttle
from sitl.core.errors import SitlError
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.action import Action


def crash(reason: str = "test") -> Action:
    """The autopilot disarms as after hitting something."""
    return Action(lambda simulation: simulation.autopilot.crash(reason))


def restart_autopilot() -> Action:
    """The autopilot reboots: silent for 1.5 s, its motors off, then in its first mode."""
    return Action(lambda simulation: simulation.autopilot.restart())


def jump_clock(seconds: float) -> Action:
    """The autopilot's time since boot leaps, forward or back."""
    return Action(lambda simulation: simulation.autopilot.jump_clock(seconds))


def jump_odometry(
    north_m: float = 0.0, east_m: float = 0.0, down_m: float = 0.0, yaw_deg: float = 0.0
) -> Action:
    """The autopilot's estimate is elsewhere from one moment to the next."""
    yaw_rad = math.radians(yaw_deg)
    return Action(
        lambda simulation: simulation.autopilot.estimate.jump(north_m, east_m, down_m, yaw_rad)
    )


def lose_flow(for_s: float | None = None) -> Action:
    """The floor shows no texture: the autopilot has no position, and lands after some seconds."""
    return Action(
        lambda simulation: simulation.autopilot.lose_flow(lost=True),
        lambda simulation: simulation.autopilot.lose_flow(lost=False),
        for_s,
    )


def battery(percent: float) -> Action:
    """So much is left from now on."""
    return Action(lambda simulation: simulation.autopilot.set_battery(percent / 100))


def refuse_arming(for_s: float | None = None) -> Action:
    """The autopilot's own checks complain."""
    return Action(
        lambda simulation: simulation.autopilot.refuse_arming(refuse=True),
        lambda simulation: simulation.autopilot.refuse_arming(refuse=False),
        for_s,
    )


MODE_NAMES = {"ardupilot": ARDUCOPTER_MODES, "px4": PX4_MODES}


class ModeError(SitlError, ValueError):
    """A mode that the autopilot does not have; says which it has."""


def pilot_mode(name: str, throttle: str = "low") -> Action:
    """The pilot's mode switch: "LOITER", "LAND", PX4's "POSCTL" and so on.

    Without the throttle stick at its middle, "mid", the drone sinks or falls in every mode in which
    the pilot flies.

    Raises:
        ModeError: neither autopilot has it; when it is carried out, this one has not.
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
    """The pilot, or a ground station, arms it."""
    return Action(lambda simulation: simulation.autopilot.pilot_arms())


def mute(message: str, for_s: float | None = None) -> Action:
    """The autopilot does not send such messages, such as "EXTENDED_SYS_STATE"."""
    return Action(
        lambda simulation: simulation.autopilot.mute.add(message),
        lambda simulation: simulation.autopilot.mute.discard(message),
        for_s,
    )


def stay_taking_off(for_s: float | None = None) -> Action:
    """The autopilot tells that it is taking off for as long as it flies."""
    return Action(
        lambda simulation: simulation.autopilot.stay_taking_off(stays=True),
        lambda simulation: simulation.autopilot.stay_taking_off(stays=False),
        for_s,
    )


def claim(vehicle: str | None = None, autopilot: str | None = None) -> Action:
    """Heartbeats tell another MAV_TYPE, such as "GROUND_ROVER", or MAV_AUTOPILOT, "GENERIC"."""
    told = _number("MAV_TYPE", vehicle), _number("MAV_AUTOPILOT", autopilot)
    return Action(lambda simulation: simulation.autopilot.claim(*told))


def _number(enum: str, name: str | None) -> int | None:
    if name is None:
        return None
    numbers: dict[str, int] = {
        entry.name.removeprefix(f"{enum}_"): number for number, entry in mavlink.enums[enum].items()
    }
    return numbers[_one_of(list(numbers), name, enum)]
