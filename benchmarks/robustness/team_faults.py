"""Flies teams with faults: `python -m benchmarks.robustness.team_faults --out DIR [--flights 300]`.

Half of the flights have a fault, drawn at random with its time and its drone: the radio fails for
one drone, or for all for a minute, or loses 30 % of the packets and delays the others by up to
0.3 s; a drone crashes; a drone stands 1.2 m and 20° off its pad. Worlds and seeds are drawn at
random. Prints a row for each kind of flight: collisions with anything, flights in which two drones
came nearer than 0.6 m, and flights of which no map was made. The fall of the drone that crashes is
no collision. 300 flights take about eight hours on two cores; the same command resumes an
interrupted campaign.
"""

import argparse
import math
import random
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.resumed import run_remaining
from companion.app import App
from companion.config import settings
from companion.core.frames import moved
from sitl.bench.engine import attempted
from sitl.core.errors import SitlError
from sitl.core.radio import LinkErrors
from sitl.scoring.team_report import scored
from sitl.sensors.beam import RAY
from sitl.simulation.fleet import Fleet
from sitl.simulation.record import AIRBORNE_M
from sitl.simulation.simulation import Setup, start_state
from sitl.simulation.team import fly_team_in_lockstep
from sitl.simulation.team_pads import team_setups
from sitl.simulation.team_radio import USUAL_ERRORS, TeamAir
from sitl.world.loading import load_world

WORLDS = {
    "room_100": "room",
    "room_200": "room",
    "two_room_300": "building",
    "office": "building",
    "exterior": "exterior",
    **{f"random_{seed}": "building" for seed in range(2, 12)},
}
"""Worlds and their missions."""
BAD_RADIO = LinkErrors(loss=0.3, jitter_s=0.3)
PARTITION_S = 60.0
"""Time for which all radios fail, s."""
OFF_PAD_FRD_M, OFF_PAD_DEG = (0.85, -0.85), 20.0
"""How the drone stands off its pad: forward and left, m, nearer to the first drone, but not within
0.6 m of it; and turned."""
FAULT_FROM_S, FAULT_TO_S = 15.0, 90.0
"""Time of a fault after the start, s."""
MIN_APART_M = 0.6
"""Distance between the centres of two drones that a flight must keep, m."""


class TeamFault(StrEnum):
    """What fails."""

    NOTHING = "no fault"
    RADIO_OF_ONE = "radio of one drone"
    RADIO_OF_ALL = "all radios for a minute"
    BAD_RADIO = "30 % loss, 0.3 s"
    CRASH = "a drone crashes"
    OFF_PAD = "a drone is off its pad"


@dataclass(frozen=True, slots=True)
class FaultJob:
    """A team flight with a fault."""

    number: int
    world: str
    seed: int
    fault: TeamFault
    drone: int
    """Number of the drone that has the fault, from 0."""
    at_s: float


@dataclass(frozen=True, slots=True)
class FaultFlown:
    """What a flight showed."""

    job: FaultJob
    collisions: int = 0
    apart_m: float | None = None
    coverage: float = math.nan
    endings: tuple[str, ...] = ()
    why_lost: str = ""
    """Why there is no map; empty if there is one."""


@dataclass(slots=True)
class Script:
    """Injects the fault of a job."""

    job: FaultJob
    has_crashed: bool = False

    def __call__(self, fleet: Fleet, apps: Sequence[App], air: TeamAir) -> None:
        job, now_s = self.job, fleet.time_s
        if now_s < job.at_s:
            return
        match job.fault:
            case TeamFault.RADIO_OF_ONE:
                air.reach = lambda sender, receiver: job.drone not in {sender, receiver}
            case TeamFault.RADIO_OF_ALL:
                is_parted = now_s < job.at_s + PARTITION_S
                air.reach = lambda sender, receiver: not is_parted
            case TeamFault.CRASH:
                self._crash(fleet, air)
            case _:
                pass

    def _crash(self, fleet: Fleet, air: TeamAir) -> None:
        autopilot = fleet.vehicles[self.job.drone].autopilot
        if not self.has_crashed and -autopilot.truth.position_ned_m[2] > AIRBORNE_M:
            self.has_crashed = True
            autopilot.crash("a fault of the campaign")
            air.reach = lambda sender, receiver: self.job.drone != sender


def jobs(flights: int) -> list[FaultJob]:
    """Every second flight has a fault."""
    draw = random.Random(1)
    faults = [fault for fault in TeamFault if fault is not TeamFault.NOTHING]
    return [
        FaultJob(
            number,
            draw.choice(list(WORLDS)),
            draw.randrange(1, 10_000),
            draw.choice(faults) if number % 2 else TeamFault.NOTHING,
            draw.randrange(2),
            draw.uniform(FAULT_FROM_S, FAULT_TO_S),
        )
        for number in range(flights)
    ]


def fly(job: FaultJob) -> FaultFlown:
    """Fly; an exception becomes a row of the results."""
    return attempted(job, _fly, lost)


def lost(job: FaultJob, why: str) -> FaultFlown:
    """The row of a flight that was lost."""
    return FaultFlown(job, why_lost=why)


def _fly(job: FaultJob) -> FaultFlown:
    began_s = time.monotonic()
    config = settings.load(None, {"mission.kind": WORLDS[job.world]})
    setup = Setup(load_world(job.world), job.world, job.seed, config.sensors, beam=RAY)
    setups, configs = team_setups(setup, config, 2)
    if job.fault is TeamFault.OFF_PAD:
        setups[1] = off_the_pad(setups[1])
    script = Script(job)
    radio = BAD_RADIO if job.fault is TeamFault.BAD_RADIO else USUAL_ERRORS
    flight = fly_team_in_lockstep(setups, configs, _ignore, script=script, radio_errors=radio)
    truths = [vehicle.record for vehicle in flight.fleet.vehicles]
    whole = [
        truth
        for number, truth in enumerate(truths)
        if not (script.has_crashed and number == job.drone)
    ]
    flown = FaultFlown(
        job,
        sum(truth.collisions for truth in whole),
        truths[0].apart_m,
        endings=tuple(app.flight.ending for app in flight.apps),
    )
    try:
        coverage = scored(setup, configs, flight, time.monotonic() - began_s).joint["coverage"]
    except SitlError as error:
        return replace(flown, why_lost=str(error))
    return replace(flown, coverage=float(coverage or 0.0))


def off_the_pad(setup: Setup) -> Setup:
    """The drone stands elsewhere than it is told, towards the first drone."""
    state = start_state(setup)
    start_ne_m = state.position_ned_m[0], state.position_ned_m[1]
    place = moved(start_ne_m, OFF_PAD_FRD_M, state.yaw_rad)
    start = setup.world.starts[0].model_copy(
        update={"position": place, "heading_deg": math.degrees(state.yaw_rad) + OFF_PAD_DEG}
    )
    return replace(setup, world=setup.world.model_copy(update={"starts": (start,)}))


def _ignore(number: int, progress: object) -> None:
    """The campaign has its own progress bar."""


def table(flown: Sequence[FaultFlown]) -> Table:
    """A row for each kind of fault."""
    shown = Table("fault")
    counts: dict[str, Callable[[FaultFlown], bool]] = {
        "flights": lambda each: True,
        "with a collision": lambda each: each.collisions > 0,
        f"nearer than {MIN_APART_M} m": lambda each: (each.apart_m or math.inf) < MIN_APART_M,
        "without a map": lambda each: bool(each.why_lost),
    }
    for heading in counts:
        shown.add_column(heading, justify="right")
    for fault in TeamFault:
        of_kind = [each for each in flown if each.job.fault is fault]
        shown.add_row(fault.value, *(str(sum(map(is_it, of_kind))) for is_it in counts.values()))
    return shown


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for the results")
    parser.add_argument("--flights", type=int, default=300)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    flown = run_remaining(
        given.out / "team_faults.pickle",
        jobs(given.flights),
        is_of=lambda each, job: each.job == job,
        run_one=fly,
        lose_one=lost,
        progress_text=lambda each: f"{each.job.world}, {each.job.fault}: {each.endings}",
    )
    console = Console(highlight=False)
    console.print(table(flown))
    for each in flown:
        if each.collisions or each.why_lost or (each.apart_m or math.inf) < MIN_APART_M:
            console.print(f"{each}", soft_wrap=True, markup=False)


if __name__ == "__main__":
    main()
