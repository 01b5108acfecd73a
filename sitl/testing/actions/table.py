"""Lists all actions by name."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from sitl.testing.actions.action import Action
from sitl.testing.actions.link import bad_link, link_down, other_rates
from sitl.testing.actions.sensors import (
    bias_gyro,
    break_bus,
    dead_adc,
    dead_gyro,
    hang_bus,
    noisy,
    saturate_gyro,
    stick,
    swap,
    unplug,
)
from sitl.testing.actions.surroundings import gust, hang, somebody, somebody_near, starve
from sitl.testing.actions.vehicle import (
    battery,
    claim,
    crash,
    jump_clock,
    jump_odometry,
    lose_flow,
    mute,
    pilot_arms,
    pilot_mode,
    refuse_arming,
    restart_autopilot,
    stay_taking_off,
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
"""All actions by name, for mission files."""
