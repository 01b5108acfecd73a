"""Measures the cost of recording: `python -m benchmarks.robustness.recording [--runs 5]`.

Prints the figures of docs/recording.md: size and content of a recording, and the CPU time of the
same flight with and without recording, one after the other on one core.
"""

import argparse
import statistics
import tempfile
import time
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader

from companion.config import settings as configuration
from companion.config.settings import Config
from companion.recording.recorder import NOT_RECORDED, Recorder, open_recorder
from companion.ticks import Progress
from sitl.bench.speed import on_one_core
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.simulation import Setup
from sitl.world.loading import load_world

WORLD = "room_200"


def ignore(progress: Progress) -> None:
    """Ignore the progress, so that the map is not drawn."""


def fly(config: Config, recorder: Recorder, transport: str) -> tuple[float, float]:
    """CPU time of the flight with its map, and flight time, s."""
    setup = Setup(load_world(WORLD), WORLD, 1, config.sensors)
    began_s = time.process_time()
    app, simulation = fly_in_lockstep(setup, config, ignore, transport, recorder=recorder)
    recorder.close(app.final_floor_plan())
    return time.process_time() - began_s, simulation.time_s


def compare(config: Config, transport: str, runs: int) -> None:
    ratios = []
    for _ in range(runs):
        without_s, flight_s = fly(config, NOT_RECORDED, transport)
        with tempfile.TemporaryDirectory() as folder:
            recorder = open_recorder(Path(folder), config, time.time(), print)
            with_s, _ = fly(config, recorder, transport)
        ratios.append(with_s / without_s)
    added_us = 1e6 * (statistics.median(ratios) - 1) * without_s / (flight_s * 20)
    print(
        f"{transport:7} CPU time with recording, over without: median "
        f"{statistics.median(ratios):.3f} of {runs} pairs; {added_us:.0f} µs a tick"
    )


def print_size(config: Config) -> None:
    with tempfile.TemporaryDirectory() as folder:
        recorder = open_recorder(Path(folder), config, time.time(), print)
        _, flight_s = fly(config, recorder, "direct")
        minutes = flight_s / 60
        for path in sorted(Path(folder).iterdir()):
            size_mb = path.stat().st_size / 1e6
            print(f"{path.suffix:6} {size_mb:.2f} MB, {size_mb / minutes:.2f} MB a minute")
        (mcap,) = Path(folder).glob("*.mcap")
        counts: Counter[str] = Counter()
        sizes: Counter[str] = Counter()
        with mcap.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                counts[channel.topic] += 1
                sizes[channel.topic] += len(message.data)
    for topic, count in counts.most_common():
        rate_hz, rate_kb_s = count / flight_s, sizes[topic] / flight_s / 1000
        print(f"  {topic:11} {rate_hz:6.2f} messages a second, {rate_kb_s:6.2f} kB/s unpacked")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    on_one_core()
    config = configuration.load(None, {})
    print_size(config)
    for transport in ("direct", "bytes"):
        compare(config, transport, options.runs)


if __name__ == "__main__":
    main()
