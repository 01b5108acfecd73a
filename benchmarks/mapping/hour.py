"""Maps a log of one hour at 50 Hz: `python -m benchmarks.mapping.hour`.

Prints rows, verdict, ATE, CPU time and peak memory of `companion map`'s work, without the files it
writes. Prints the figures of docs/offline.md.
"""

import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.mapping.offline import score_path
from benchmarks.mapping.offline_logs import SCENARIOS, record, write_csv
from benchmarks.measured import peak_mb
from companion.offline.mapper import map_log
from companion.offline.reading.log import ignore
from companion.offline.reading.readers import read_log
from companion.offline.reading.sensors import SensorsConfig

HOUR_S = 3600.0
ROUNDS, RATE_HZ = 70, 50.0
"""Rounds through the two rooms, which take more than an hour together, and rows a second."""


def main() -> None:
    scenario = SCENARIOS["two rooms"]()
    start, *rest = scenario.flight.waypoints_m
    flight = replace(scenario.flight, waypoints_m=[start, *ROUNDS * rest], rate_hz=RATE_HZ)
    truth = record(replace(scenario, flight=flight), seed=1).until(HOUR_S)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "hour.csv"
        write_csv(truth, path)
        recorded_mb = peak_mb()
        begin_s = time.process_time()
        log = read_log(path, ignore)
        result = map_log(log, SensorsConfig(), ignore)
        cpu_s = time.process_time() - begin_s
    ate_cm = score_path(truth, result.path).ate_cm
    print(f"{len(log.time_s)} rows, {result.verdict.word}, ATE {ate_cm:.1f} cm")
    print(f"{cpu_s:.0f} s of CPU, peak {peak_mb():.0f} MB ({recorded_mb:.0f} MB before)")


if __name__ == "__main__":
    main()
