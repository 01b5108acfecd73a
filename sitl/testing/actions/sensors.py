"""Faults of buses, range sensors and gyro."""

import math

from companion.core.messages import Beam
from sitl.sensors.sharp import USUAL_MEMORY
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.action import Action, Switch


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


def _check(beam: str) -> None:
    if beam not in list(Beam):
        raise ValueError(f"no beam {beam!r}; known: {', '.join(Beam)}")
