"""Places the drones of a team on pads near the start pose of a world.

Each drone is told where the pads are, and stands some centimetres and degrees off its own.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from companion.config.settings import Config
from companion.config.team import PadConfig, TeamConfig
from companion.config.toml_file import validated
from companion.core.frames import Vector2, moved
from sitl.core.errors import SitlError
from sitl.core.noise import stream
from sitl.simulation.fleet import member_setup
from sitl.simulation.simulation import Setup, start_state
from sitl.world.format import Start
from sitl.world.geometry.model import BODY_RADIUS_M, WorldModel

TEAM = TeamConfig(name="sitl")
"""Defaults of a team: how exactly the drones stand on their pads."""
PADS_APART_M, MAX_PADS_APART_M, PAD_STEP_M = 2.0, 6.0, 0.25
"""Least distance between two pads, greatest from the start, and step between the distances that are
tried, m. Chosen: a drone climbs while its neighbour waits."""
PAD_BEARINGS = 24
"""Bearings from the start that are tried for a pad. Chosen."""
PAD_CLEAR_M = (0.4, 0.35, 0.3, 0.25)
"""Clearances of a hull over a pad and on the way to it, m, tried in this order. Chosen: the first
is that of a start; nearer to a wall a drone returns only slowly."""


def team_setups(setup: Setup, settings: Config, drones: int) -> tuple[list[Setup], list[Config]]:
    """A setup and a configuration for each drone; a single one flies without a team.

    Raises:
        SitlError: there is no place for a pad.
        ConfigError: the mission is not one that so many drones divide.
    """
    if drones == 1:
        return [setup], [settings]
    pads = team_pads(setup, settings.mission.height_m, drones)
    configs = []
    for number in range(drones):
        team = TEAM.model_copy(update={"drone": number + 1, "pads": pads})
        link = settings.link.model_copy(update={"system_id": settings.link.system_id + number})
        own = {"team": team.model_dump(), "link": link.model_dump()}
        values = settings.model_dump() | own
        configs.append(validated(Config, values, f"--team {drones}"))
    return setups_on_pads(setup, pads), configs


def setups_on_pads(setup: Setup, pads: Sequence[PadConfig]) -> list[Setup]:
    """A setup for each drone; those after the first stand off their pads."""
    take_off = start_state(setup)
    start_ne_m = take_off.position_ned_m[0], take_off.position_ned_m[1]
    setups = []
    for number, pad in enumerate(pads):
        draw = stream(setup.seed, f"pad {number}")
        error_m, error_rad = (
            (TEAM.pad_sigma_m, math.radians(TEAM.pad_sigma_deg)) if number else (0.0, 0.0)
        )
        north_m, east_m = moved(start_ne_m, (pad.north_m, pad.east_m), take_off.yaw_rad)
        heading_deg = math.degrees(take_off.yaw_rad + draw.gauss(0, error_rad))
        place = draw.gauss(north_m, error_m), draw.gauss(east_m, error_m)
        pose = Start(name=f"pad {number + 1}", position=place, heading_deg=heading_deg)
        world = setup.world.model_copy(update={"starts": (pose,)})
        setups.append(replace(member_setup(setup, number), world=world, start=0))
    return setups


def team_pads(setup: Setup, height_m: float, drones: int) -> tuple[PadConfig, ...]:
    """The pads around the start; the first is the start itself.

    `height_m`: height of the mission, at which there must be space.

    Raises:
        SitlError: there is no place for a pad.
    """
    take_off = start_state(setup)
    start_ne_m = take_off.position_ned_m[0], take_off.position_ned_m[1]
    model = WorldModel(setup.world)

    def is_free(offset: Vector2, clear_m: float) -> bool:
        """True if the way up from the pad, and from there to above the start, is free."""
        pad = moved(start_ne_m, offset, take_off.yaw_rad)
        ways = (moved(start_ne_m, (s * offset[0], s * offset[1]), take_off.yaw_rad) for s in _WAY)
        places = [(*pad, -s * height_m) for s in _WAY] + [(*place, -height_m) for place in ways]
        return all(model.clearance_m(place) > BODY_RADIUS_M + clear_m for place in places)

    chosen: list[Vector2] = [(0.0, 0.0)]
    for clear_m, offset in product(PAD_CLEAR_M, _candidates()):
        is_apart = all(math.dist(offset, each) > PADS_APART_M - 1e-3 for each in chosen)
        if len(chosen) < drones and is_apart and is_free(offset, clear_m):
            chosen.append(offset)
    if len(chosen) < drones:
        raise SitlError(
            f"--team {drones}: there is room for {len(chosen)} pads near the start; choose another "
            "start, or fewer drones"
        )
    return tuple(PadConfig(north_m=ahead, east_m=right) for ahead, right in chosen)


def pads_as_toml(pads: Sequence[PadConfig]) -> str:
    """The pads as a line for the table `[team]` of each companion."""
    tables = (pad.model_dump(exclude_defaults=True) for pad in pads)
    texts = (", ".join(f"{key} = {value}" for key, value in table.items()) for table in tables)
    return f"pads = [{', '.join(f'{{ {text} }}' if text else '{}' for text in texts)}]"


def _candidates() -> Iterator[Vector2]:
    """Places for pads, nearest first; those to the right of the start before the others."""
    steps = round((MAX_PADS_APART_M - PADS_APART_M) / PAD_STEP_M)
    for away_m in (PADS_APART_M + PAD_STEP_M * step for step in range(steps + 1)):
        for number in range(PAD_BEARINGS):
            bearing_rad = math.pi / 2 + math.tau * number / PAD_BEARINGS
            yield (
                round(away_m * math.cos(bearing_rad), 3),
                round(away_m * math.sin(bearing_rad), 3),
            )


_WAY = tuple(np.linspace(0.0, 1.0, 25).tolist())
"""Shares of the way up from a pad, and from the start to it."""
