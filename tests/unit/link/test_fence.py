"""The fence that the autopilot gets, if it is to be written."""

from typing import Any

import pytest

from companion.config.settings import Config
from companion.link.firmware import Fence
from companion.link.link import Link
from companion.link.transports.transport import direct_pair
from companion.run.hardware import fence_to_set
from sitl.simulation.simulation import Setup, Simulation
from sitl.world.loading import load_world

LIMITS = {"max_height_m": 2.5, "max_distance_m": 8}


def config_of(*, set_fence: bool, **mission: float) -> Config:
    return Config.model_validate({"link": {"set_fence": set_fence}, "mission": mission})


def parameters_after(autopilot: str, fence: Fence | None) -> tuple[dict[str, float], str]:
    """Parameters that the companion has set, and what it still waits for."""
    config, written = Config(), dict[str, float]()
    setup = Setup(load_world("room_100"), "room_100", 1, config.sensors, autopilot)
    sitl_end, companion_end = direct_pair(setup.system_id)
    simulation = Simulation(setup, [sitl_end], lambda name, value: written.update({name: value}))
    link, vehicle = Link(companion_end, config.link, fence=fence), None
    for _ in range(160):
        simulation.advance(simulation.time_s + 0.05)
        vehicle = link.poll(simulation.time_s).vehicle
        link.send(simulation.time_s, None, None)
    assert vehicle is not None
    return written, vehicle.waits_for


@pytest.mark.parametrize(
    ("autopilot", "fence", "expected"),
    [
        (
            "ardupilot",
            Fence(2.5, 8.0),
            {
                "FENCE_ENABLE": 1,
                "FENCE_TYPE": 3,
                "FENCE_ACTION": 2,
                "FENCE_MARGIN": 1,
                "FENCE_ALT_MAX": 3.5,
                "FENCE_RADIUS": 9,
            },
        ),
        ("ardupilot", Fence(2.5, None), {"FENCE_TYPE": 1, "FENCE_ALT_MAX": 3.5}),
        (
            "px4",
            Fence(2.5, 8.0),
            {"GF_ACTION": 5, "GF_MAX_VER_DIST": 3.5, "GF_MAX_HOR_DIST": 9},
        ),
        ("px4", Fence(None, 8.0), {"GF_ACTION": 5, "GF_MAX_HOR_DIST": 9}),
    ],
)
def test_the_fence_is_written_a_metre_outside_and_lands(
    autopilot: str, fence: Fence, expected: dict[str, float]
) -> None:
    written, waits_for = parameters_after(autopilot, fence)
    assert expected.items() <= written.items()
    assert not waits_for


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_nothing_is_written_unless_asked(autopilot: str) -> None:
    written, _ = parameters_after(autopilot, None)
    assert not any(name.startswith(("FENCE_", "GF_")) for name in written)


def test_only_a_configuration_that_asks_for_it_writes_a_fence() -> None:
    any_limits: dict[str, Any] = LIMITS
    assert fence_to_set(config_of(set_fence=True, **any_limits)) == Fence(2.5, 8.0)
    assert fence_to_set(config_of(set_fence=False, **any_limits)) is None
    assert fence_to_set(config_of(set_fence=True)) is None
