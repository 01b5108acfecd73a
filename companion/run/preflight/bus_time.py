"""Measures how long the sensors take to read: the control loop reads all of them in every tick."""

from collections.abc import Callable
from statistics import median

from companion.core.errors import SensorError
from companion.run.clocks import Clock
from companion.safety.health.lateness import TICK_S

SWEEPS = 9
"""Number of measured sweeps; their median counts. Chosen: a scheduler's pause spoils one or two."""
MAX_SHARE = 0.8
"""Largest share of a tick for reading all sensors. Chosen: the flight itself takes up to 10 ms on a
Raspberry Pi."""


def sweep_time_s(read: Callable[[float], object], clock: Clock) -> float:
    """Median time of a call of `read`, which reads all sensors at a time, s."""
    times_s = []
    for _ in range(SWEEPS):
        began_s = clock.now_s()
        read(began_s)
        times_s.append(clock.now_s() - began_s)
    return median(times_s)


def is_slow(sweep_s: float) -> bool:
    """True if a sweep leaves too little of the tick."""
    return sweep_s > MAX_SHARE * TICK_S


def slow_bus_remedy(bus: str, sweep_s: float) -> str:
    """What is too slow, and the remedy."""
    return (
        f"sensors.bus = {bus}: reading all sensors takes {1000 * sweep_s:.0f} ms of the "
        f"{1000 * TICK_S:.0f} ms of a tick: set i2c_arm_baudrate=400000 in config.txt, as "
        "deploy/boot_config.py does, shorten the wires, or remove what else uses the bus"
    )


def refuse_slow_bus(read: Callable[[float], object], clock: Clock, bus: str) -> None:
    """Refuse a flight whose control loop would always be late.

    Raises:
        SensorError: the sensors take most of a tick or more.
    """
    sweep_s = sweep_time_s(read, clock)
    if is_slow(sweep_s):
        raise SensorError(slow_bus_remedy(bus, sweep_s))
