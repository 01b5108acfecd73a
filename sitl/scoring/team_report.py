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
from sitl.scoring.joint import Outcome, airborne_s, return_m, together
from sitl.scoring.report import Report, make_report
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup
from sitl.simulation.team import TeamFlight


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
    """Make and score the joint map.

    Raises:
        SitlError: no flight can be made into a map.
    """
    truths = [vehicle.record for vehicle in flight.fleet.vehicles]
    merged = merged_flights(configs, flight.apps)
    joint = make_report(
        setup,
        configs[0],
        merged.plan,
        together(truths, merged),
        outcome=Outcome(flight.apps),
        waited_s=waited_s,
    )
    joint["return_m"] = round(max(map(return_m, truths)), 4)
    joint["flight_time_s"] = round(airborne_s(truths), 4)
    joint["apart_m"] = round(flight.fleet.least_apart_m, 4)
    rows = [
        _row(number, app, truth, flight.air.sent_bytes[number])
        for number, (app, truth) in enumerate(zip(flight.apps, truths, strict=True))
    ]
    return TeamResult(joint, rows, merged)


def merged_flights(configs: Sequence[Config], apps: Sequence[App]) -> Merged:
    """Make the joint map; the flight of the first drone is "flight 1".

    Raises:
        SitlError: no flight can be made into a map.
    """
    team = configs[0].team
    flown, given = [], {}
    for number, (app, pad) in enumerate(zip(apps, team.pads, strict=True), 1):
        name = f"flight {number}"
        try:
            flown.append(Flown.of(name, app))
        except SurveyError:
            continue
        given[name] = relative_pad(team.pads[0], pad)
    if not flown:
        raise SitlError("no flight of the team can be made into a map")
    return merge(flown, Starts(pad_sigma(team), given))


def _row(number: int, app: App, truth: TruthRecord, sent_bytes: int) -> Report:
    """Results of one drone."""
    return {
        "drone": number + 1,
        "completed": app.flight.completed and truth.collisions == 0,
        "ending": app.flight.ending,
        "flight_time_s": round(truth.air_time_s, 2),
        "collisions": truth.collisions,
        "clearance_m": round(truth.clearance_m, 4),
        "return_m": round(return_m(truth), 4),
        "radio_bytes_s": round(sent_bytes / max(truth.path[-1].time_s, 1.0), 1),
    }
