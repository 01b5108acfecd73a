"""Faults of buses, range sensors and gyro."""

import math

from companion.core.messages import Beam
from sitl.sensors.sharp import USUAL_MEMORY
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.action import Action, Switch


def break_bus(for_s: float | None = None) -> Action:
    """No sensor responds."""

    def switch(*, broken: bool) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.board.bus.is_broken = broken

        return turn

    return Action(switch(broken=True), switch(broken=False), for_s)


def hang_bus(transfer_s: float = 1.0, for_s: float | None = None) -> Action:
    """Every transfer on the sensors' wires times out after `transfer_s`, as in a kernel."""

    def switch(hangs_s: float) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.board.bus.hangs_s = hangs_s

        return turn

    return Action(switch(transfer_s), switch(0.0), for_s)


def dead_adc(for_s: float | None = None) -> Action:
    """The chips of the range sensors do not respond; the gyro does."""

    def die(simulation: Simulation) -> None:
        simulation.board.bus.dead_addresses |= simulation.board.adc_addresses

    def come_back(simulation: Simulation) -> None:
        simulation.board.bus.dead_addresses -= simulation.board.adc_addresses

    return Action(die, come_back, for_s)


def unplug(beam: str, for_s: float | None = None, memory: float = USUAL_MEMORY) -> Action:
    """Unplug a range sensor: "front", "left", "right", "up" or "down".

    An ADC's open input keeps the share `memory` of the chip's previous conversion. With 0.9 the
    voltage looks like a distance.
    """
    _check(beam)
    return Action(
        lambda simulation: simulation.board.unplug(beam, memory),
        lambda simulation: simulation.board.plug_in(beam),
        for_s,
    )


def stick(beam: str, for_s: float | None = None) -> Action:
    """A range sensor repeats its last measurement."""
    _check(beam)
    return Action(
        lambda simulation: simulation.board.stick(beam, stuck=True),
        lambda simulation: simulation.board.stick(beam, stuck=False),
        for_s,
    )


def noisy(beam: str, times: float = 10.0, for_s: float | None = None) -> Action:
    """Multiply a range sensor's noise by a factor."""
    _check(beam)
    return Action(
        lambda simulation: simulation.board.set_noise(beam, times),
        lambda simulation: simulation.board.set_noise(beam, 1.0),
        for_s,
    )


def swap(one: str, other: str) -> Action:
    """Swap the directions of two range sensors."""
    _check(one)
    _check(other)
    return Action(lambda simulation: simulation.board.swap(one, other))


def dead_gyro(for_s: float | None = None) -> Action:
    """The gyro does not respond; the range sensors do."""

    def die(simulation: Simulation) -> None:
        simulation.board.bus.dead_addresses.add(simulation.board.gyro_address)

    def come_back(simulation: Simulation) -> None:
        simulation.board.bus.dead_addresses.discard(simulation.board.gyro_address)

    return Action(die, come_back, for_s)


def saturate_gyro(for_s: float | None = None) -> Action:
    """The gyro reads its full scale."""

    def switch(*, saturated: bool) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.board.gyro.is_saturated = saturated

        return turn

    return Action(switch(saturated=True), switch(saturated=False), for_s)


def bias_gyro(deg_s: float, for_s: float | None = None) -> Action:
    """Add a bias to the gyro's readings."""

    def switch(rad_s: float) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.board.gyro.fault_bias_rad_s = rad_s

        return turn

    return Action(switch(math.radians(deg_s)), switch(0.0), for_s)


def _check(beam: str) -> None:
    if beam not in list(Beam):
        raise ValueError(f"no beam {beam!r}; known: {', '.join(Beam)}")
