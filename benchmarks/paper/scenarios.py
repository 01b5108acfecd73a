"""The scenarios of the paper as flights, and their times.

1  one UAV traces rooms of 100, 200 and 300 m²
2  two UAVs trace opposite halves of the same rooms
3  one UAV first flies to the largest distance from the wall that its sensors allow

Speed 1 m/s, range 5 m, each flight 15 times. The times are those of one round, from the opening
turn to the end of the trace.
"""

from dataclasses import dataclass
from pathlib import Path

from sitl.campaign.definition import Campaign
from sitl.campaign.flight import CampaignFlight
from sitl.campaign.run import run
from sitl.campaign.scores import Mean, Row

ROOMS = {"room_100": "100 m²", "room_200": "200 m²", "room_300": "300 m²"}
RUNS = 15
"""Flights of each bar, as in the paper."""
LIMIT_S = 3600.0
TIME, WHOLE, ERROR = "scan_time_s", "flight_time_s", "wall_error_aligned_cm"


@dataclass(frozen=True, slots=True)
class Variant:
    """What a scenario compares."""

    name: str
    drones: int
    standoff: float | str
    """Distance from the wall, m, or `range`: the largest reliable one."""


PDPS = Variant("one UAV", 1, 1.5)
TWO = Variant("two UAVs", 2, 1.5)
ADJUSTED = Variant("one UAV, adjusted to the range", 1, "range")
VARIANTS = PDPS, TWO, ADJUSTED


def flight(room: str, variant: Variant, seed: int) -> CampaignFlight:
    """A flight with the paper's sensors, whose range is 5 m."""
    return CampaignFlight(
        {
            "world": room,
            "seed": seed,
            "profile": "paper",
            "mission": "room",
            "team": variant.drones,
            "mission.speed_m_s": 1.0,
            "mission.standoff": variant.standoff,
        }
    )


def flown(folder: Path, runs: int) -> dict[tuple[str, str], list[Row]]:
    """The rows of each room and variant; flown if they are not in the folder yet."""
    keys = [(room, variant) for room in ROOMS for variant in VARIANTS]
    flights = {
        (room, variant.name): [flight(room, variant, seed) for seed in range(1, runs + 1)]
        for room, variant in keys
    }
    everything = tuple(each for those in flights.values() for each in those)
    rows = {row["flight"]: row for row in run(Campaign(everything, (), LIMIT_S, None), folder)}
    return {
        key: [rows[each.flight] for each in those if each.flight in rows]
        for key, those in flights.items()
    }


def mean(rows: list[Row], key: str) -> Mean:
    """Mean of a column over the completed flights."""
    return Mean.of([float(row[key]) for row in rows if row["completed"]])
