"""Runs several vehicles in one world, in common steps of 10 ms."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from companion.link.transports.transport import Transport
from sitl.autopilot.core import FIRMWARES
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.core.errors import SitlError
from sitl.core.truth import TrueState
from sitl.core.vehicle import STEP_S
from sitl.simulation.record import AIRBORNE_M
from sitl.simulation.simulation import Setup, Simulation
from sitl.simulation.traffic import Others, downwash_m_s, no_others

SEEDS_APART = 1000
"""Difference between the seeds of two vehicles. Chosen."""


def fleet_setups(setup: Setup, vehicles: int) -> list[Setup]:
    """One setup per vehicle: system ids and start poses in order, each with its own seed.

    Raises:
        SitlError: the world has too few start poses.
    """
    starts = len(setup.world.starts)
    if vehicles > starts:
        raise SitlError(
            f"{setup.world_name} has {starts} start poses, {vehicles} vehicles need one each; "
            "add [[starts]] to it"
        )
    return [
        replace(member_setup(setup, number), start=(setup.start + number) % starts)
        for number in range(vehicles)
    ]


def member_setup(setup: Setup, number: int) -> Setup:
    """The setup of a vehicle, by its number from 0: with its own seed and system id."""
    if number == 0:
        return setup
    parameter = FIRMWARES[setup.autopilot]().system_id_parameter
    return replace(
        setup,
        seed=setup.seed + SEEDS_APART * number,
        parameters={**setup.parameters, parameter: setup.system_id + number},
    )


class Fleet:
    """Simulations that detect each other."""

    def __init__(
        self,
        setups: Sequence[Setup],
        transports: Sequence[Sequence[Transport]],
        watch: ParameterWatch,
    ) -> None:
        self.vehicles: list[Simulation] = []
        for number, (setup, links) in enumerate(zip(setups, transports, strict=True)):
            others = self._others_of(number) if len(setups) > 1 else no_others
            self.vehicles.append(Simulation(setup, links, watch, others))

    def _others_of(self, number: int) -> Others:
        def others() -> list[TrueState]:
            return [
                vehicle.autopilot.truth
                for other, vehicle in enumerate(self.vehicles)
                if other != number
            ]

        return others

    @property
    def time_s(self) -> float:
        return self.vehicles[0].time_s

    def advance(self, time_s: float) -> None:
        """Advance all vehicles to `time_s`."""
        if len(self.vehicles) == 1:
            self.vehicles[0].advance(time_s)
            return
        while self.time_s < time_s - 1e-9:
            step_to_s = self.time_s + STEP_S
            self._blow()
            for vehicle in self.vehicles:
                vehicle.advance(step_to_s)
            self._measure()

    def _blow(self) -> None:
        """Push down each vehicle that is below another one in the air."""
        positions = [vehicle.autopilot.truth.position_ned_m for vehicle in self.vehicles]
        airborne = [position for position in positions if -position[2] > AIRBORNE_M]
        for vehicle, position in zip(self.vehicles, positions, strict=True):
            vehicle.autopilot.push_down(downwash_m_s(position, airborne))

    def _measure(self) -> None:
        positions = (vehicle.autopilot.truth.position_ned_m for vehicle in self.vehicles)
        airborne = [
            (position, vehicle.record)
            for position, vehicle in zip(positions, self.vehicles, strict=True)
            if -position[2] > AIRBORNE_M
        ]
        for (one, its), (other, others) in combinations(airborne, 2):
            apart_m = math.dist(one, other)
            its.observe_other(apart_m)
            others.observe_other(apart_m)
