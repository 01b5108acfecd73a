"""What happens in a scripted flight, and when: faults, and what the pilot does.

script=[at(30, link_down(for_s=5)), when("scanning", pilot_mode("LOITER"))]
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.app import App
from companion.core.frames import Vector3, frd_to_ned
from companion.core.messages import Beam
from companion.link.firmware import ARDUCOPTER_MODES, PX4_MODES
from sitl.autopilot.firmware import Throttle
from sitl.core.errors import SitlError
from sitl.core.radio import NO_TROUBLES, Troubles
from sitl.sensors.sharp import USUAL_MEMORY
from sitl.simulation.simulation import Simulation

GROUND_STATION = 255
"""The system id of most."""
Switch = Callable[[Simulation], None]


def _for_good(simulation: Simulation) -> None:
    """It is never taken back."""


@dataclass(frozen=True, slots=True)
class Action:
    """Something done to the simulation, and how it is undone after a while, if it is."""

    begin: Switch
    undo: Switch = _for_good
    for_s: float | None = None


@dataclass(frozen=True, slots=True)
class Event:
    """An action and the condition on which it begins, once.

    A flight in which it never begins has not tested what it should, unless it is optional.
    """

    is_due: Callable[[Simulation, App], bool]
    action: Action
    is_optional: bool = False
    name: str = "an Event of its own"
    """As it is told when it never happened."""


def at(time_s: float, action: Action) -> Event:
    """At a time of the flight, seconds since the start."""
    return Event(
        lambda simulation, app: simulation.time_s >= time_s, action, name=f"at {time_s:g} s"
    )


def when(activity: str, action: Action) -> Event:
    """When the companion first says that it does something, such as "scanning"."""
    return Event(
        lambda simulation, app: activity in app.flight.activity, action, name=f"when {activity!r}"
    )


def optional(event: Event) -> Event:
    """The same, in a flight that may end before it happens."""
    return replace(event, is_optional=True)


def watch(look: Callable[[Simulation, App], object]) -> Event:
    """Nothing happens, but `look` is called at every tick."""

    def is_due(simulation: Simulation, app: App) -> bool:
        look(simulation, app)
        return False

    return Event(is_due, Action(lambda simulation: None), is_optional=True)


# The link


def bad_link(
    loss: float = 0.0,
    duplicates: float = 0.0,
    reordering: float = 0.0,
    jitter_s: float = 0.0,
    for_s: float | None = None,
) -> Action:
    """MAVLink suffers in both directions: shares of all messages, and the most they are late."""
    troubles = Troubles(loss, duplicates, reordering, jitter_s)
    return Action(
        lambda simulation: simulation.disturb_link(troubles),
        lambda simulation: simulation.disturb_link(NO_TROUBLES),
        for_s,
    )


def link_down(for_s: float | None = None) -> Action:
    """MAVLink is lost in both directions."""
    return bad_link(loss=1.0, for_s=for_s)


def other_rates(message: str, rate_hz: float) -> Action:
    """A ground station on the companion's link asks for a message at its own rate; 0 stops it."""
    ids = {kind.msgname: number for number, kind in mavlink.mavlink_map.items()}
    if message not in ids:
        raise ValueError(f"no message {message!r} in MAVLink; as in 'ATTITUDE'")
    interval_us = 1e6 / rate_hz if rate_hz > 0 else -1.0

    def ask(simulation: Simulation) -> None:
        asked = mavlink.MAVLink_command_long_message(
            *(0, mavlink.MAV_COMP_ID_AUTOPILOT1),
            *(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, ids[message], interval_us, 0, 0, 0, 0, 0),
        )
        asked._header.srcSystem = GROUND_STATION
        asked._header.srcComponent = mavlink.MAV_COMP_ID_MISSIONPLANNER
        simulation.autopilot.receive(asked)

    return Action(ask)


# The sensors


def break_bus(for_s: float | None = None) -> Action:
    """No sensor answers."""

    def switch(*, broken: bool) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.board.bus.is_broken = broken

        return turn

    return Action(switch(broken=True), switch(broken=False), for_s)


def hang_bus(transfer_s: float = 1.0, for_s: float | None = None) -> Action:
    """Every transfer on the sensors' wires is given up only after so long, as by the kernel."""

    def switch(hangs_s: float) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.board.bus.hangs_s = hangs_s

        return turn

    return Action(switch(transfer_s), switch(0.0), for_s)


def dead_adc(for_s: float | None = None) -> Action:
    """The chips of the range sensors do not answer; the gyro does."""

    def die(simulation: Simulation) -> None:
        simulation.board.bus.dead_addresses |= simulation.board.adc_addresses

    def come_back(simulation: Simulation) -> None:
        simulation.board.bus.dead_addresses -= simulation.board.adc_addresses

    return Action(die, come_back, for_s)


def unplug(beam: str, for_s: float | None = None, memory: float = USUAL_MEMORY) -> Action:
    """A range sensor loses its plug: "front", "left", "right", "up" or "down".

    At an ADC its input is open then, and shows the share `memory` of what the chip has converted
    before: with 0.9 it looks like a distance.
    """
    _check(beam)
    return Action(
        lambda simulation: simulation.board.unplug(beam, memory),
        lambda simulation: simulation.board.plug_in(beam),
        for_s,
    )


def stick(beam: str, for_s: float | None = None) -> Action:
    """A range sensor tells its last measurement again and again."""
    _check(beam)
    return Action(
        lambda simulation: simulation.board.stick(beam, stuck=True),
        lambda simulation: simulation.board.stick(beam, stuck=False),
        for_s,
    )


def noisy(beam: str, times: float = 10.0, for_s: float | None = None) -> Action:
    """A range sensor has so many times its noise."""
    _check(beam)
    return Action(
        lambda simulation: simulation.board.set_noise(beam, times),
        lambda simulation: simulation.board.set_noise(beam, 1.0),
        for_s,
    )


def swap(one: str, other: str) -> Action:
    """Two range sensors look where the other one should."""
    _check(one)
    _check(other)
    return Action(lambda simulation: simulation.board.swap(one, other))


def dead_gyro(for_s: float | None = None) -> Action:
    """The gyro does not answer; the range sensors do."""

    def die(simulation: Simulation) -> None:
        simulation.board.bus.dead_addresses.add(simulation.board.gyro_address)

    def come_back(simulation: Simulation) -> None:
        simulation.board.bus.dead_addresses.discard(simulation.board.gyro_address)

    return Action(die, come_back, for_s)


def saturate_gyro(for_s: float | None = None) -> Action:
    """The gyro reads as much as it can."""

    def switch(*, saturated: bool) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.board.gyro.is_saturated = saturated

        return turn

    return Action(switch(saturated=True), switch(saturated=False), for_s)


def bias_gyro(deg_s: float, for_s: float | None = None) -> Action:
    """The gyro reads so much more than before."""

    def switch(rad_s: float) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.board.gyro.fault_bias_rad_s = rad_s

        return turn

    return Action(switch(math.radians(deg_s)), switch(0.0), for_s)


# The vehicle


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
        lambda simulation: simulation.autopilot.believed.jump(north_m, east_m, down_m, yaw_rad)
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


# The world, and the companion itself


def somebody(places: Sequence[tuple[float, float, float]], for_s: float | None = None) -> Action:
    """People stand at these places: north, east and height, metres, of head and shoulders."""
    bodies = [(north_m, east_m, -height_m) for north_m, east_m, height_m in places]

    def come(simulation: Simulation) -> None:
        simulation.bystanders += bodies

    def go(simulation: Simulation) -> None:
        for body in bodies:
            simulation.bystanders.remove(body)

    return Action(come, go, for_s)


def somebody_near(forward_m: float, right_m: float = 0.0, for_s: float | None = None) -> Action:
    """Somebody steps up, so far ahead and to the right of the drone's centre, and stands there."""
    bodies: list[Vector3] = []

    def come(simulation: Simulation) -> None:
        truth = simulation.autopilot.truth
        north_m, east_m, down_m = truth.position_ned_m
        off_north_m, off_east_m = frd_to_ned(forward_m, right_m, truth.yaw_rad)
        bodies.append((north_m + off_north_m, east_m + off_east_m, down_m))
        simulation.bystanders += bodies

    def go(simulation: Simulation) -> None:
        for body in bodies:
            simulation.bystanders.remove(body)

    return Action(come, go, for_s)


def gust(north_m_s: float, east_m_s: float, for_s: float | None = None) -> Action:
    """The air carries the drone along."""
    return Action(
        lambda simulation: simulation.autopilot.blow(north_m_s, east_m_s),
        lambda simulation: simulation.autopilot.blow(0.0, 0.0),
        for_s,
    )


def hang(for_s: float) -> Action:
    """The companion does nothing for so long, then goes on."""

    def stop(simulation: Simulation) -> None:
        simulation.companion_hangs_until_s = simulation.time_s + for_s

    return Action(stop)


def starve(
    least_s: float = 0.2,
    most_s: float = 2.0,
    for_s: float | None = None,
    *,
    between_reads: bool = False,
) -> Action:
    """The companion's computer has no time: each tick is late by a time between these.

    `between_reads`: it stands still within ticks instead, now and then, so that link, gyro and
    range sensors are read at different times.
    """
    return Action(
        lambda simulation: simulation.starvation.begin(
            least_s, most_s, between_reads=between_reads
        ),
        lambda simulation: simulation.starvation.end(),
        for_s,
    )


ACTIONS: Mapping[str, Callable[..., Action]] = MappingProxyType(
    {
        action.__name__: action
        for action in (
            *(bad_link, link_down, other_rates),
            *(break_bus, hang_bus, dead_adc, unplug, stick, noisy, swap),
            *(dead_gyro, saturate_gyro, bias_gyro),
            *(crash, restart_autopilot, jump_clock, jump_odometry, lose_flow, battery),
            *(
                refuse_arming,
                pilot_mode,
                pilot_arms,
                mute,
                stay_taking_off,
                claim,
                somebody,
                somebody_near,
                gust,
                hang,
                starve,
            ),
        )
    }
)
"""All of them by name."""


def _check(beam: str) -> None:
    if beam not in list(Beam):
        raise ValueError(f"no beam {beam!r}; known: {', '.join(Beam)}")


class Play:
    """The script that carries out the events, each once, and undoes them when their time is up."""

    def __init__(self, events: Sequence[Event]) -> None:
        self._waiting = list(events)
        self._running: list[tuple[float, Action]] = []

    def __call__(self, simulation: Simulation, app: App) -> None:
        """One tick."""
        for event in [event for event in self._waiting if event.is_due(simulation, app)]:
            self._waiting.remove(event)
            event.action.begin(simulation)
            if event.action.for_s is not None:
                self._running.append((simulation.time_s + event.action.for_s, event.action))
        for until_s, action in [r for r in self._running if simulation.time_s >= r[0]]:
            self._running.remove((until_s, action))
            action.undo(simulation)

    @property
    def missed(self) -> str:
        """What should have happened and has not; nothing if all has."""
        return ", ".join(event.name for event in self._waiting if not event.is_optional)
