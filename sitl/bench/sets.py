"""Selects missions to fly: worlds by the name of a set, their starts, and seeds."""

from collections.abc import Sequence
from pathlib import Path

from sitl.bench.missions import Job
from sitl.running.options import Autopilot, FlightOptions
from sitl.testing.mission_file import load_mission
from sitl.world.format import WorldError
from sitl.world.loading import IMPORTERS, load_world, world_names

RANDOM = tuple(f"random_{seed}" for seed in range(1, 51))
"""Random buildings of seeds 1 to 50. Number chosen."""
NOT_IN_THE_PAPER = ("office", "exterior")
MISSIONS = {
    **dict.fromkeys(("room_100", "room_200", "room_300"), "room"),
    "exterior": "exterior",
}
"""Mission for a world; `building` for all others."""
PLAN_SUFFIXES = (".toml", *IMPORTERS)
MAX_STARTS = 3
"""Starts flown per plan."""

Place = tuple[str, str | None]
"""An argument of `load_world`, and the number of a start pose; None is the first."""


def from_first_starts(jobs: Sequence[Job]) -> list[Job]:
    """The flights from the first start of each world, or of each plan in a folder."""
    return [job for job in jobs if job.options.start in (None, "1")]


def jobs_for(
    worlds: Sequence[str],
    seeds: int,
    profiles: Sequence[str],
    mission: str | None = None,
    *,
    autopilot: Autopilot = Autopilot.ARDUPILOT,
    crop_m: float | None = None,
    battery_s: float | None = None,
    clutters: Sequence[float] = (0.0,),
    clutter_seed: int | None = None,
) -> list[Job]:
    """Flights of every seed from every place with every profile and clutter, 0 to 1.

    Without a mission, each world's own.

    Raises:
        WorldError, ConfigError, MissionError: an option is invalid for all flights.
    """

    def options(
        world: str, start: str | None, profile: str, seed: int, clutter: float = 0.0
    ) -> FlightOptions:
        return FlightOptions(
            world,
            seed,
            profile,
            autopilot,
            start,
            crop_m=crop_m,
            battery_s=battery_s,
            clutter=clutter,
            clutter_seed=clutter_seed,
        )

    settings = load_mission(mission or "building").settings
    for profile in profiles:
        options("", None, profile, 1).settings(settings)
    return [
        Job(
            options(world, start, profile, seed, clutter),
            mission or suiting(world, clutter),
        )
        for profile in profiles
        for name in worlds
        for world, start in places(name)
        for clutter in clutters
        for seed in range(1, seeds + 1)
    ]


def suiting(world: str, clutter: float) -> str:
    """The mission for a world, with clutter from 0 to 1.

    A furnished room is explored as a building: tracing would take furniture for the wall.
    """
    mission = MISSIONS.get(world, "building")
    return "building" if clutter and mission == "room" else mission


def places(name: str) -> list[Place]:
    """Places to start from: in the worlds of a set, the plans in a folder, or one world.

    Raises:
        WorldError: there is no such set, folder or world.
    """
    sets = _sets()
    if name in sets:
        return [(world, None) for world in sets[name]]
    if Path(name).is_dir():
        return _plans(Path(name))
    try:
        load_world(name)
    except WorldError as error:
        raise WorldError(f"{error}; or a set: {', '.join(sets)}, or a folder of plans") from error
    return [(name, None)]


def _sets() -> dict[str, Sequence[str]]:
    paper = [name for name in world_names() if name not in NOT_IN_THE_PAPER]
    return {
        "paper": paper,
        "office": ["office"],
        "exterior": ["exterior"],
        "random": RANDOM,
        "all": [*paper, *NOT_IN_THE_PAPER, *RANDOM],
    }


def _plans(folder: Path) -> list[Place]:
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in PLAN_SUFFIXES)
    if not files:
        raise WorldError(f"{folder}: no plans, files ending in {', '.join(PLAN_SUFFIXES)}")
    return [(str(path), str(number)) for path in files for number in range(1, _starts(path) + 1)]


def _starts(path: Path) -> int:
    """Up to three; one for a plan that is invalid, so that its row has the error."""
    try:
        return min(len(load_world(str(path)).starts), MAX_STARTS)
    except WorldError:
        return 1
