"""People, wind, and an overloaded companion computer."""

from collections.abc import Sequence

from companion.core.frames import Vector3, frd_to_ned
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.action import Action


def somebody(places: Sequence[tuple[float, float, float]], for_s: float | None = None) -> Action:
    """People stand at these places: north, east, and height of head and shoulders, m."""
    bodies = [(north_m, east_m, -height_m) for north_m, east_m, height_m in places]

    def come(simulation: Simulation) -> None:
        simulation.bystanders += bodies

    def go(simulation: Simulation) -> None:
        for body in bodies:
            simulation.bystanders.remove(body)

    return Action(come, go, for_s)


def somebody_near(forward_m: float, right_m: float = 0.0, for_s: float | None = None) -> Action:
    """A person appears at this offset from the drone's centre, at its height, and stays there."""
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
    """Wind moves the drone."""
    return Action(
        lambda simulation: simulation.autopilot.blow(north_m_s, east_m_s),
        lambda simulation: simulation.autopilot.blow(0.0, 0.0),
        for_s,
    )


def hang(for_s: float) -> Action:
    """The companion stops for this time, s, then continues."""

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
    """Overload the companion's computer: each tick is late by a random time between the limits.

    With `between_reads`, it pauses within ticks instead, at random. Link, gyro and range sensors
    are then read at different times.
    """
    return Action(
        lambda simulation: simulation.starvation.begin(
            least_s, most_s, between_reads=between_reads
        ),
        lambda simulation: simulation.starvation.end(),
        for_s,
    )
