"""One flight of a campaign: what its settings mean, and the row of its results."""

import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from companion.config.team import MAX_DRONES, TEAM_DRONES
from companion.core.frames import Vector2
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE
from sitl.bench import missions, surveys
from sitl.bench.engine import attempted
from sitl.bench.missions import Job, Physics, places_of_hits
from sitl.bench.scan_time import ScanTime
from sitl.bench.sets import suiting
from sitl.bench.surveys import SurveyJob
from sitl.campaign.scores import Row
from sitl.core.errors import SitlError
from sitl.core.program import program_version
from sitl.running.options import MAX_BATTERY_S, Autopilot, FlightOptions
from sitl.scoring.team_report import scored
from sitl.sensors.beam import BeamPhysics
from sitl.simulation.team import fly_team_in_lockstep
from sitl.simulation.team_pads import team_setups

BEAM, PARAMETER = "beam.", "param."
"""Prefixes of the keys of beam physics, and of autopilot parameters. Other keys with a dot are keys
of the companion's configuration."""
MAX_SORTIES = 20
"""Most flights of a survey. Chosen."""
HASH_LETTERS = 16
"""Length of a flight's number, hexadecimal digits: among 10⁶ flights a pair is equal by chance with
a probability of 3·10⁻⁸."""


class Options(BaseModel):
    """What a campaign varies, beside beam physics, parameters and the companion's configuration."""

    model_config = ConfigDict(frozen=True, extra="forbid", coerce_numbers_to_str=True)

    world: str = "room_100"
    seed: int = 1
    profile: str = "gp2y0a710k0f"
    autopilot: Autopilot = Autopilot.ARDUPILOT
    start: str | None = None
    crop_m: float | None = Field(None, ge=4)
    battery_s: float | None = Field(None, ge=60, le=MAX_BATTERY_S)
    clutter: float = Field(0.0, ge=0, le=1)
    clutter_seed: int | None = None
    mission: str | None = None
    """None: suits the world."""
    team: int = Field(1, ge=1, le=MAX_DRONES)
    sorties: int = Field(1, ge=1, le=MAX_SORTIES)
    noise: float = Field(1.0, ge=0, le=10)
    """Factor on the drift of odometry and gyro."""


@dataclass(frozen=True)
class CampaignFlight:
    """The settings of one flight; those that are missing have their defaults."""

    settings: Mapping[str, object]

    @cached_property
    def flight(self) -> str:
        """The flight's number: a hash of its settings, and of the world if that is a file."""
        known = {**self.settings}
        file = Path(self.options.world)
        if file.is_file():
            known["world"] = hashlib.sha256(file.read_bytes()).hexdigest()
        text = json.dumps(known, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:HASH_LETTERS]

    @property
    def key(self) -> Row:
        """Columns that identify its row."""
        return {
            "flight": self.flight,
            "program": program_version(),
            "world": self.options.world,
            "seed": self.options.seed,
            **self.settings,
        }

    @cached_property
    def options(self) -> Options:
        """Raises: ValidationError: a value is invalid."""
        return Options.model_validate(
            {key: value for key, value in self.settings.items() if "." not in key}
        )

    def job(self) -> Job:
        """The flight as the benches fly it.

        Raises:
            SitlError, CompanionError, ValidationError: a setting is invalid.
        """
        given, beam = self.options, self._under(BEAM)
        options = FlightOptions(
            given.world,
            given.seed,
            given.profile,
            given.autopilot.value,
            given.start,
            param=tuple(f"{name}={value}" for name, value in self._under(PARAMETER).items()),
            crop_m=given.crop_m,
            battery_s=given.battery_s,
            clutter=given.clutter,
            clutter_seed=given.clutter_seed,
        )
        physics = Physics(
            BeamPhysics.model_validate(beam) if beam else None, REFERENCE_NOISE.times(given.noise)
        )
        configured = {
            key: value
            for key, value in self.settings.items()
            if "." in key and not key.startswith((BEAM, PARAMETER))
        }
        mission = given.mission or suiting(given.world, given.clutter)
        most = TEAM_DRONES.get(mission, 1)
        if given.team > most:
            raise SitlError(f"team = {given.team}: at most {most} drones fly {mission!r}")
        return Job(options, mission, configured, physics)

    def check(self) -> None:
        """Check the settings, without flying.

        Raises:
            SitlError, CompanionError, ValidationError: a setting is invalid.
        """
        self.job().prepared()

    def _under(self, prefix: str) -> Row:
        return {
            key.removeprefix(prefix): value
            for key, value in self.settings.items()
            if key.startswith(prefix)
        }


def fly(flight: CampaignFlight) -> Row:
    """Fly; an exception becomes a row of the results."""
    return attempted(flight, _fly, lost)


def lost(flight: CampaignFlight, why: str) -> Row:
    """The row of a flight without a report."""
    ending = f"lost: {' '.join(why.split())}"
    return {**flight.key, "completed": False, "lost": True, "ending": ending}


def _fly(flight: CampaignFlight) -> Row:
    began_s = time.monotonic()
    job, team, sorties = flight.job(), flight.options.team, flight.options.sorties
    if sorties > 1:
        row, hits = _of(surveys.fly(SurveyJob(job, sorties, drones=team)).joint)
    elif team > 1:
        row, hits = _fly_team(job, team, began_s)
    else:
        row, hits = _of(missions.fly(job))
    return {**row, **flight.key, "hits_north_m": _each(hits, 0), "hits_east_m": _each(hits, 1)}


def _of(flown: missions.Flown) -> tuple[Row, list[Vector2]]:
    return dict(flown.row), list(flown.sketch.hits)


def _fly_team(job: Job, drones: int, began_s: float) -> tuple[Row, list[Vector2]]:
    setup, settings, _ = job.prepared()
    setups, configs = team_setups(setup, settings, drones)
    scan = ScanTime()
    flown = fly_team_in_lockstep(setups, configs, lambda number, progress: scan.watch(progress))
    team = scored(setup, configs, flown, time.monotonic() - began_s)
    hits = places_of_hits([vehicle.record for vehicle in flown.fleet.vehicles])
    return {**team.joint, **job.key, "scan_time_s": scan.seconds, "lost": False}, hits


def _each(hits: list[Vector2], axis: int) -> list[float]:
    return [round(place[axis], 2) for place in hits]
