"""Defines options that several commands share, and the setup that they select."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.config import settings as configuration
from companion.config.range_sensors import PROFILES
from companion.config.settings import Config
from sitl.autopilot.core import FIRMWARES, FLIGHT_BATTERY_S, keep_nothing
from sitl.autopilot.parameters.file import ParameterFile, beyond_range, parse_assignments
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.core.errors import SitlError
from sitl.sensors.beam import RAY, load_beam_physics
from sitl.simulation.simulation import Setup
from sitl.world.clutter import cluttered
from sitl.world.cropping import cropped
from sitl.world.format import World
from sitl.world.loading import load_world


class Autopilot(StrEnum):
    """The emulated firmware."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


WorldName = Annotated[str, typer.Argument(help="A built-in world, random_SEED, or a world file.")]
Seed = Annotated[int, typer.Option(help="Random seed; the same seed gives the same flight.")]
Profile = Annotated[str, typer.Option(help=f"Range sensors: {', '.join(PROFILES)}.")]
Start = Annotated[
    str | None, typer.Option(help="Start pose: name or number in the world; default the first.")
]
Params = Annotated[
    Path | None,
    typer.Option(help="File of autopilot parameters: read at the start, updated on changes."),
]
Param = Annotated[
    list[str] | None, typer.Option(help="NAME=VALUE: one parameter for this run; repeatable.")
]
BeamFile = Annotated[
    Path | None, typer.Option(help="TOML file of beam physics; keys in docs/sensors.md.")
]
ConfigFile = Annotated[
    Path | None, typer.Option(help="The companion's TOML file; its sensors are simulated.")
]
Crop = Annotated[
    float | None,
    typer.Option(help="Crop the world to a walled square of this side around the start, m.", min=4),
]
Clutter = Annotated[
    float,
    typer.Option(help="Furniture, curtains and open doors: 0 none, 1 maximum.", min=0, max=1),
]
ClutterSeed = Annotated[
    int | None, typer.Option(help="Seed of the clutter; default the flight's seed.")
]
MAX_BATTERY_S = 3600.0
"""Longest time of a battery, s. Chosen: twice that of large drones."""
Battery = Annotated[
    float | None,
    typer.Option(
        help=f"Time of a full battery, s; default {FLIGHT_BATTERY_S:.0f}. Limits the mission, too.",
        min=60,
        max=MAX_BATTERY_S,
    ),
]


@dataclass(frozen=True, slots=True)
class FlightOptions:
    """The options of a simulated flight, as given."""

    world: str
    seed: int
    profile: str
    autopilot: str
    start: str | None = None
    params: Path | None = None
    param: Sequence[str] = ()
    beam: Path | None = None
    crop_m: float | None = None
    config: Path | None = None
    battery_s: float | None = None
    clutter: float = 0.0
    """Difficulty, 0 to 1."""
    clutter_seed: int | None = None
    """None: the flight's seed."""

    def settings(
        self, mission: Mapping[str, object], sources: Mapping[str, str] | None = None
    ) -> Config:
        """The companion's settings: its file, overridden by the mission; `sources` as in `load`.

        The battery's flight time, if given, is also the mission's default time limit.

        Raises:
            ConfigError: a key or value is invalid.
        """
        limit = {} if self.battery_s is None else {"mission.time_limit_s": self.battery_s}
        given = {**limit, "sensors.profile": self.profile, **mission}
        return configuration.load(self.config, given, sources)

    def setup(self) -> tuple[Setup, ParameterWatch]:
        """The setup, and the function that saves changed parameters.

        Raises:
            SitlError, CompanionError: an option or file is invalid.
        """
        world = load_world(self.world)
        start = _start_number(world, self.start)
        if self.crop_m is not None:
            world, start = cropped(world, self.crop_m, start), 0
        clutter_seed = self.seed if self.clutter_seed is None else self.clutter_seed
        world = cluttered(world, self.clutter, clutter_seed)
        sensors = configuration.load(self.config, {"sensors.profile": self.profile}).sensors
        parameters, watch = read_parameters(self.autopilot, self.params, self.param)
        setup = Setup(
            world,
            self.world,
            self.seed,
            sensors,
            self.autopilot,
            parameters,
            load_beam_physics(self.beam) if self.beam else RAY,
            start,
            battery_s=self.battery_s or FLIGHT_BATTERY_S,
        )
        return setup, watch

    def arguments(self) -> list[str]:
        """The options as arguments of `sitl run`."""
        given = {
            "seed": self.seed,
            "profile": self.profile,
            "autopilot": self.autopilot,
            "start": self.start,
            "params": self.params,
            "beam": self.beam,
            "crop": self.crop_m,
            "config": self.config,
            "battery-s": self.battery_s,
            "clutter": self.clutter or None,
            "clutter-seed": self.clutter_seed,
        }
        options = [f"--{name}={value}" for name, value in given.items() if value is not None]
        return [self.world, *options, *(f"--param={assignment}" for assignment in self.param)]


def read_parameters(
    autopilot: str, file: Path | None, assignments: Sequence[str]
) -> tuple[dict[str, float], ParameterWatch]:
    """Initial parameters, with assignments overriding the file, and the function that saves."""
    table = FIRMWARES[autopilot]().table
    given = parse_assignments(assignments, table)
    for warning in beyond_range(given, table):
        Console(stderr=True, highlight=False).print(f"sitl: --param {warning}", soft_wrap=True)
    if file is None:
        return given, keep_nothing
    kept = ParameterFile(file, table)
    return kept.values | given, kept.keep


def _start_number(world: World, start: str | None) -> int:
    names = [pose.name for pose in world.starts]
    if start is None:
        return 0
    if start in names:
        return names.index(start)
    if start.isdecimal() and 1 <= int(start) <= len(names):
        return int(start) - 1
    known = ", ".join(names)
    raise SitlError(f"--start {start}: {world.name} has {known}, or numbers 1 to {len(names)}")
