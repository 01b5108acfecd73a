"""Shared by all tests: a whole flight in one process."""

from collections.abc import Callable

import pytest

from companion import config as configuration
from companion.app import App, Progress
from sitl.lockstep import Script, fly_in_lockstep, no_script
from sitl.simulation import Setup, Simulation
from sitl.world.loading import load_world

Fly = Callable[..., tuple[App, Simulation]]


@pytest.fixture
def fly() -> Fly:
    """Flies a world with a seed and a profile; settings as {"mission.speed_m_s": 0.5}."""

    def fly_it(
        world: str = "room_100",
        seed: int = 1,
        *,
        profile: str = "gp2y0a710k0f",
        transport: str = "direct",
        autopilot: str = "ardupilot",
        script: Script = no_script,
        **overrides: object,
    ) -> tuple[App, Simulation]:
        settings = configuration.load(None, {"sensors.profile": profile, **overrides})
        setup = Setup(load_world(world), world, seed, settings.sensors, autopilot)

        def watch(progress: Progress) -> None:
            """Nobody looks."""

        return fly_in_lockstep(setup, settings, watch, transport, script)

    return fly_it
