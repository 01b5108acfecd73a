"""Makes and scores the joint map of a team."""

from collections.abc import Sequence
from dataclasses import dataclass

from companion.app import App
from companion.config.settings import Config
from companion.core.errors import SurveyError
from companion.survey.flights import Flown
from companion.survey.merge import Merged, Starts, merge
from companion.team.pads import pad_sigma, relative_pad
from sitl.core.errors import SitlError
from sitl.scoring.joint import Outcome, airborne_s, apart_m, flight_name, return_m, together
from sitl.scoring.report import Report, make_report
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup
from sitl.simulation.team import TeamFlight


@dataclass(frozen=True, slots=True)
class FlownDrone:
    """A drone of a team at the end of its flight."""

    app: App | None
    """Its companion at the end; None if that recorded nothing."""
    truth: TruthRecord
    sent_bytes: int
    """Sent by its radio."""
    crash: str = ""
    """How its companion crashed; empty if the flight ended by its rules."""

    @property
    def completed(self) -> bool:
        return not self.crash and self.app is not None and self.app.flight.completed

    @property
    def ending(self) -> str:
        flown = self.app.flight.ending if self.app else "nothing was recorded"
        return f"{self.crash}; {flown}" if self.crash else flown


@dataclass(frozen=True, slots=True)
class TeamResult:
    """A flight of a team as `sitl fly` reports it."""

    joint: Report
    """Scores of the joint map, with the keys of a single flight's report."""
    rows: list[Report]
    """Each drone's own results."""
    merged: Merged

    def as_json(self) -> dict[str, object]:
        """The scores, with the rows as `drones`."""
        return {**self.joint, "drones": self.rows}


def scored(
    setup: Setup, configs: Sequence[Config], flight: TeamFlight, waited_s: float
) -> TeamResult:
    """Make and score the joint map of a team in one process; see `scored_together`."""
    ends = zip(flight.apps, flight.fleet.vehicles, flight.air.sent_bytes, strict=True)
    drones = [FlownDrone(app, vehicle.record, sent) for app, vehicle, sent in ends]
    return scored_together(setup, configs[0], drones, waited_s)


def scored_together(
    setup: Setup, config: Config, drones: Sequence[FlownDrone], waited_s: float
) -> TeamResult:
    """Make and score the joint map. `config`: of the first drone.

    Raises:
        SitlError: no flight can be made into a map.
    """
    truths = [drone.truth for drone in drones]
    merged = merged_flights([config], [drone.app for drone in drones])
    joint = make_report(
        setup,
        config,
        merged.plan,
        together(truths, merged),
        outcome=Outcome(drones),
        waited_s=waited_s,
    )
    joint["return_m"] = round(max(map(return_m, truths)), 4)
    joint["flight_time_s"] = round(airborne_s(truths), 4)
    joint["apart_m"] = apart_m(truths)
    rows = [_row(number, drone) for number, drone in enumerate(drones, 1)]
    return TeamResult(joint, rows, merged)


def merged_flights(configs: Sequence[Config], apps: Sequence[App | None]) -> Merged:
    """Make the joint map; the flight of the first drone is "flight 1".

    `apps`: None for a drone that recorded nothing.

    Raises:
        SitlError: no flight can be made into a map.
    """
    team = configs[0].team
    flown, given = [], {}
    for number, (app, pad) in enumerate(zip(apps, team.pads, strict=True), 1):
        name = flight_name(number)
        if app is None:
            continue
        try:
            flown.append(Flown.of(name, app))
        except SurveyError:
            continue
        given[name] = relative_pad(team.pads[0], pad)
    if not flown:
        raise SitlError("no flight of the team can be made into a map")
    return merge(flown, Starts(pad_sigma(team), given))


def _row(number: int, drone: FlownDrone) -> Report:
    """Results of one drone."""
    truth = drone.truth
    return {
        "drone": number,
        "completed": drone.completed and truth.collisions == 0,
        "ending": drone.ending,
        "flight_time_s": round(truth.air_time_s, 2),
        "collisions": truth.collisions,
        "clearance_m": round(truth.clearance_m, 4),
        "return_m": round(return_m(truth), 4),
        "radio_bytes_s": round(drone.sent_bytes / max(truth.path[-1].time_s, 1.0), 1),
    }
