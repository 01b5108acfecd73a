"""Flies a mission in a test and gives access to its results."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from companion.app import App
from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.messages import FloorPlan
from companion.recording.recorder import NOT_RECORDED, open_recorder
from companion.ticks import Progress
from sitl.autopilot.core import NO_PARAMETERS
from sitl.core.radio import LinkErrors
from sitl.scoring.report import Report, make_report
from sitl.scoring.team_report import TeamResult, scored
from sitl.sensors.beam import beam_physics
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup, Simulation
from sitl.simulation.team import Script as TeamScript
from sitl.simulation.team import TeamFlight, fly_team_in_lockstep, no_script
from sitl.simulation.team_pads import team_setups
from sitl.simulation.team_radio import USUAL_ERRORS
from sitl.testing.mission_file import load_mission
from sitl.testing.script import Event, Play
from sitl.world.clutter import cluttered
from sitl.world.format import World
from sitl.world.loading import load_world, world_names


def _fail(warning: str) -> None:
    raise AssertionError(warning)


class MissedError(AssertionError):
    """The flight ended before an event of its script, so the test has not tested it."""


class ReportView:
    """Attribute access to the report's keys, such as `report.coverage`."""

    def __init__(self, report: Report) -> None:
        self._report = report

    def __getattr__(self, key: str) -> Any:
        if key not in self._report:
            known = ", ".join(sorted(self._report))
            raise AttributeError(f"no {key!r} in the report; it has {known}")
        return self._report[key]


@dataclass
class Flight:
    """The result of a flight."""

    app: App
    simulation: Simulation
    setup: Setup
    config: Config
    waited_s: float

    @property
    def completed(self) -> bool:
        """The mission was completed without a collision."""
        return self.app.flight.completed and self.truth.collisions == 0

    @property
    def ending(self) -> str:
        """The companion's text on how the flight ended."""
        return self.app.flight.ending

    @property
    def truth(self) -> TruthRecord:
        """The true path, clearance and collisions."""
        return self.simulation.record

    @cached_property
    def plan(self) -> FloorPlan:
        """The companion's map."""
        return self.app.final_floor_plan()

    @cached_property
    def report(self) -> ReportView:
        """All scores, by the keys of `sitl fly --report`."""
        return ReportView(
            make_report(
                self.setup,
                self.config,
                self.plan,
                self.truth,
                outcome=self.app.flight,
                waited_s=self.waited_s,
            )
        )


@dataclass
class TeamOutcome:
    """The result of a team's flight."""

    flight: TeamFlight
    """Companions, vehicles and radio."""
    result: TeamResult

    @property
    def completed(self) -> bool:
        """All drones completed the mission without a collision."""
        return bool(self.result.joint["completed"])

    @property
    def plan(self) -> FloorPlan:
        """The joint map."""
        return self.result.merged.plan

    @property
    def report(self) -> ReportView:
        """Scores of the joint map, by the keys of `sitl fly --team --report`."""
        return ReportView(self.result.joint)

    @property
    def drones(self) -> list[ReportView]:
        """Results of each drone."""
        return [ReportView(row) for row in self.result.rows]


class Sitl:
    """Flies missions in simulation. Relative file names are searched in `folder` first."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def fly(
        self,
        world: str,
        *,
        mission: str = "room",
        seed: int = 1,
        profile: str = "gp2y0a710k0f",
        autopilot: str = "ardupilot",
        transport: str = "direct",
        config: str | None = None,
        settings: Mapping[str, object] | None = None,
        parameters: Mapping[str, float] = NO_PARAMETERS,
        beam: Mapping[str, object] | None = None,
        clutter: float = 0.0,
        clutter_seed: int | None = None,
        script: Sequence[Event] = (),
        record: Path | None = None,
    ) -> Flight:
        """Fly one mission to its end; `fly_team` flies several drones.

        Args:
            world: name of a built-in world, or a file.
            mission: kind of mission, or a mission file.
            seed: seed of the flight; the same seed gives the same flight.
            profile: profile of the range sensors.
            autopilot: "ardupilot" or "px4".
            transport: "direct" for message objects, "bytes" for encoded frames.
            config: the companion's TOML file.
            settings: single values that override it, such as {"mission.speed_m_s": 0.5}.
            parameters: the autopilot's, such as {"GUID_TIMEOUT": 1}.
            beam: keys of docs/sensors.md, such as {"width_deg": 2}.
            clutter: difficulty of the clutter, 0 to 1.
            clutter_seed: seed of the clutter; default the flight's.
            script: faults and pilot actions.
            record: folder for the flight's recording.

        Raises:
            WorldError, ConfigError, MissionError, ParameterError, BeamError: a file or value is
                invalid.
            MissedError: the flight ended before an event of `script` or of the mission file.
        """
        flown = load_mission(str(self._path(mission)))
        overrides = {"sensors.profile": profile, **flown.settings, **(settings or {})}
        loaded = configuration.load(self._path(config) if config else None, overrides)
        used_seed = seed if clutter_seed is None else clutter_seed
        name, place = self._world(world, clutter, used_seed)
        physics = beam_physics(beam or {}, "beam")
        setup = Setup(place, name, seed, loaded.sensors, autopilot, parameters, physics)
        began_s = time.monotonic()

        def watch(progress: Progress) -> None:
            """Ignore the progress."""

        events = Play([*flown.events, *script])
        recorder = open_recorder(record, loaded, time.time(), _fail) if record else NOT_RECORDED
        app, simulation = fly_in_lockstep(
            setup,
            loaded,
            watch,
            transport,
            events,
            recorder=recorder,
        )
        flight = Flight(app, simulation, setup, loaded, time.monotonic() - began_s)
        if record:
            recorder.close(flight.plan)
        if events.missed:
            raise MissedError(
                f"the flight ended after {simulation.time_s:.1f} s, {flight.ending!r}, before "
                f"these events: {events.missed}; use optional(...) for those that need not happen"
            )
        return flight

    def fly_team(
        self,
        world: str,
        drones: int = 2,
        *,
        mission: str = "room",
        seed: int = 1,
        profile: str = "gp2y0a710k0f",
        autopilot: str = "ardupilot",
        settings: Mapping[str, object] | None = None,
        clutter: float = 0.0,
        radio: LinkErrors = USUAL_ERRORS,
        script: TeamScript = no_script,
    ) -> TeamOutcome:
        """Fly a team until its last drone has ended.

        Args:
            world: name of a built-in world, or a file.
            drones: number of drones; their pads stand near the world's first start.
            mission: as in the configuration.
            seed: seed of the flight; the same seed gives the same flight.
            profile: profile of the range sensors.
            autopilot: "ardupilot" or "px4".
            settings: single values of every companion's configuration.
            clutter: difficulty of the clutter, 0 to 1.
            radio: errors of the radio between the drones.
            script: called before every tick; may inject faults.

        Raises:
            WorldError, ConfigError: a file or value is invalid.
            SitlError: there is no place for a pad.
        """
        overrides = {"sensors.profile": profile, "mission.kind": mission, **(settings or {})}
        loaded = configuration.load(None, overrides)
        name, place = self._world(world, clutter, seed)
        setup = Setup(place, name, seed, loaded.sensors, autopilot)
        setups, configs = team_setups(setup, loaded, drones)
        began_s = time.monotonic()

        def watch(number: int, progress: Progress) -> None:
            """Ignore the progress."""

        flight = fly_team_in_lockstep(setups, configs, watch, script=script, radio_errors=radio)
        result = scored(setup, configs, flight, time.monotonic() - began_s)
        return TeamOutcome(flight, result)

    def _world(self, world: str, clutter: float, clutter_seed: int) -> tuple[str, World]:
        """Name and content of a world."""
        name = world if world in world_names() else str(self._path(world))
        return name, cluttered(load_world(name), clutter, clutter_seed)

    def _path(self, name: str) -> Path:
        beside = self._folder / name
        return beside if beside.exists() else Path(name)
