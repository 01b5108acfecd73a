"""Kills a campaign three times: `python -m benchmarks.robustness.killed_campaign --out DIR`.

The same flights of mixed worlds are flown twice: undisturbed on this machine's cores, and on a
scheduler and two workers of their own. Of the latter a worker, the scheduler and the command are
ended by SIGKILL, one after the other, and started again. Prints what differs between both. The
flights are short, 12 to 22 s in the air; the default of two thousand takes an hour and a quarter on
two cores.
"""

import argparse
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from functools import cache
from pathlib import Path

from pyarrow import parquet

from sitl.campaign.definition import load_campaign
from sitl.campaign.results import read_rows, row_files
from sitl.campaign.scores import Row
from sitl.scoring.report import WALL_CLOCK_KEYS

CAMPAIGN = """
[vary]
world = ["paper", "random"]
seed = {{ from = 1, to = 1000000 }}
autopilot = ["ardupilot", "px4"]
clutter = {{ from = 0.0, to = 0.6 }}
"mission.time_limit_s" = 25
"mission.reserve_s" = 0

[draw]
flights = {flights}
"""
STARTS_S = 5.0
"""Time for a scheduler to begin to listen, s. Chosen."""
CHECK_S = 0.2


class Cluster:
    """A scheduler and workers as processes of their own, on loopback."""

    def __init__(self, stack: ExitStack) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self._stack = stack

    def start_scheduler(self) -> subprocess.Popen[bytes]:
        started = self._start(
            "scheduler",
            "--host=127.0.0.1",
            f"--port={self.port}",
            "--dashboard-address=127.0.0.1:0",
        )
        time.sleep(STARTS_S)
        return started

    def start_worker(self) -> subprocess.Popen[bytes]:
        """A worker without a nanny: nobody starts it again."""
        options = ("--nthreads=1", "--no-dashboard", "--host=127.0.0.1", "--no-nanny")
        return self._start("worker", self.address, *options)

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *arguments]
        started = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._stack.callback(started.kill)
        return started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=2000, help="flights; default 2000")
    parser.add_argument("--out", type=Path, required=True, help="folder for both campaigns")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    file = given.out / "killed.toml"
    file.write_text(CAMPAIGN.format(flights=given.flights))
    undisturbed, disturbed = given.out / "undisturbed", given.out / "disturbed"
    fly_disturbed(file, disturbed, given.flights)
    subprocess.run(fly(file, undisturbed), check=True)
    wanted = {flight.flight for flight in load_campaign(file).flights}
    rows = {folder: comparable(folder) for folder in (undisturbed, disturbed)}
    differ = [key for key in wanted if rows[undisturbed].get(key) != rows[disturbed].get(key)]
    kept = _rows(disturbed)  # with those that would be there twice
    print(f"{len(wanted)} flights wanted, {kept} rows, {len(differ)} differ")
    raise SystemExit(1 if differ or kept != len(wanted) else 0)


def fly(file: Path, out: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "sitl", "campaign", str(file), f"--out={out}", *more]


def fly_disturbed(file: Path, out: Path, flights: int) -> None:
    """End a worker, the scheduler and the command, after a quarter, a half and three quarters."""
    with ExitStack() as stack:
        cluster = Cluster(stack)
        scheduler = cluster.start_scheduler()
        worker, _ = cluster.start_worker(), cluster.start_worker()
        command = fly(file, out, f"--scheduler={cluster.address}")
        flying = subprocess.Popen(command)

        def until(share: float) -> None:
            while _rows(out) < share * flights:
                time.sleep(CHECK_S)

        until(0.25)
        worker.send_signal(signal.SIGKILL)
        cluster.start_worker()
        print(f"a worker was killed after {_rows(out)} flights", flush=True)
        until(0.5)
        scheduler.send_signal(signal.SIGKILL)
        print(f"the scheduler was killed after {_rows(out)} flights", flush=True)
        flying.wait()
        cluster.start_scheduler()
        cluster.start_worker()
        cluster.start_worker()
        flying = subprocess.Popen(command)
        until(0.75)
        flying.send_signal(signal.SIGKILL)
        flying.wait()
        print(f"the command was killed after {_rows(out)} flights", flush=True)
        subprocess.run(command, check=True)


def _rows(folder: Path) -> int:
    return sum(map(_rows_in, row_files(folder / "rows")))


@cache
def _rows_in(file: Path) -> int:
    """Number of rows in a file, which never changes; 0 if it has just been joined with others."""
    try:
        return int(parquet.read_metadata(file).num_rows)
    except FileNotFoundError:
        return 0


def comparable(folder: Path) -> dict[str, Row]:
    """Each row by its flight, without what depends on the computer's load."""
    return {
        row["flight"]: {key: row[key] for key in row if key not in WALL_CLOCK_KEYS}
        for row in read_rows(folder)
    }


if __name__ == "__main__":
    main()
