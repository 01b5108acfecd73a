"""Times the joint map of ten flights: `python -m benchmarks.survey.ten_flights [--flights 10]`.

The flights of six minutes begin on one pad in the paper's `complex` world. Each is solved alone
first, as after its landing. Then the joint map is made, as by `companion survey`: its time and the
greatest memory of the process. At last a flight is flown that knows the map of five: the processor
time of a tick, and of all ticks for each second in the air. Use one core, with nothing beside:
`taskset -c 0 python -m ...`.
"""

import argparse
import time
from functools import partial

import numpy as np

from benchmarks.measured import peak_mb
from benchmarks.timed import TimedApp
from companion.config import settings
from companion.earlier import EarlierFlights
from companion.survey.flights import Flown
from companion.survey.folder import Pad
from companion.survey.merge import Merged, Starts, merge
from sitl.running.sorties import on_the_pad
from sitl.sensors.beam import RAY
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.simulation import Setup
from sitl.world.loading import load_world

WORLD, LIMIT_S = "complex", 380.0
"""World, and time limit of a flight, s. Chosen: ten flights last about an hour."""
KNOWN = 5
"""Flights that the last one knows. Chosen."""


def fly(number: int, earlier: EarlierFlights | None = None) -> TimedApp:
    """One flight."""
    given = {"mission.kind": "building", "mission.time_limit_s": LIMIT_S}
    config = settings.load(None, given)
    world = load_world(WORLD)
    setup = Setup(world, WORLD, 1, config.sensors, "ardupilot", {}, RAY)
    app, _ = fly_in_lockstep(
        on_the_pad(setup, number, world),
        config,
        lambda _: None,
        make_app=partial(TimedApp, earlier=earlier),
    )
    assert isinstance(app, TimedApp)
    return app


def joint(flown: list[Flown]) -> tuple[Merged, float]:
    """The joint map, and the time that it took, s of the processor."""
    began_s = time.process_time()
    merged = merge(flown, Starts(Pad().sigma))
    return merged, time.process_time() - began_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=10, help="number of flights, default 10")
    count = parser.parse_args().flights
    flown: list[Flown] = []
    for number in range(1, count + 1):
        app = fly(number)
        began_s = time.process_time()
        flown.append(Flown.of(f"flight {number}", app))
        alone_s = time.process_time() - began_s
        print(
            f"flight {number}: {app.flown_s:.0f} s, alone {alone_s:.1f} s",
            flush=True,
        )
    flown_s = sum(float(np.sum(each.m.dt_s)) for each in flown)
    merged, took_s = joint(flown)
    memory_mb = peak_mb()
    print(f"joint map of {len(merged.flights)} flights, {flown_s:.0f} s in the air: {took_s:.1f} s")
    print(
        f"walls {len(merged.plan.walls)}, changes {len(merged.changes)}, memory {memory_mb:.0f} MB"
    )
    earlier = joint(flown[:KNOWN])[0].for_next_flight(Pad().sigma)
    last = fly(count + 1, earlier)
    print(f"with {KNOWN} earlier flights: {last.ms_per_s:.0f} ms for each second of flight")
    print(f"a tick: median {last.tick_ms(50):.1f}, 99 % {last.tick_ms(99):.1f} ms")


if __name__ == "__main__":
    main()
