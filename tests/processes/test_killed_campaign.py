"""Tests a campaign that is killed, and goes on: no flight is lost, or has two rows.

`python -m benchmarks.robustness.killed_campaign` does it with two thousand flights.
"""

import signal
import subprocess
from pathlib import Path

import psutil

from sitl.campaign.definition import load_campaign
from sitl.campaign.flight import fly
from sitl.campaign.results import read_rows
from sitl.campaign.scores import Row
from sitl.scoring.report import WALL_CLOCK_KEYS
from tests.processes.started import sitl
from tests.waiting import DEADLINE_S, until
from tests.worlds import SMALL_ROOM

CAMPAIGN = f"""
[vary]
world = "{SMALL_ROOM}"
seed = {{ from = 1, to = 3 }}
"mission.time_limit_s" = 20
"mission.reserve_s" = 0
"""


def test_a_killed_campaign_goes_on_and_is_equal_to_an_undisturbed_one(tmp_path: Path) -> None:
    file, out = tmp_path / "campaign.toml", tmp_path / "out"
    file.write_text(CAMPAIGN)
    command = sitl("campaign", str(file), f"--out={out}", "--workers=1")
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as killed:
        assert killed.stderr is not None
        assert killed.stderr.readline().startswith("1 of 3")
        workers = psutil.Process(killed.pid).children(recursive=True)
        killed.kill()
    until(lambda: not any(each.is_running() for each in workers), "the end of the workers")
    assert 1 <= len(read_rows(out)) < 3
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as resumed:
        assert resumed.stderr is not None
        assert resumed.stderr.readline().startswith("1 of ")
        for worker in psutil.Process(resumed.pid).children(recursive=True):
            worker.send_signal(signal.SIGKILL)
        resumed.communicate(timeout=DEADLINE_S)
    assert resumed.returncode == 0
    flights = load_campaign(file).flights
    rows = {row["flight"]: without_wall_clock(row) for row in read_rows(out)}
    assert rows == {each.flight: without_wall_clock(fly(each)) for each in flights}
    assert (out / "flights.parquet").exists()
    assert (out / "summary.json").exists()


def without_wall_clock(row: Row) -> Row:
    """The values that depend on the flight alone."""
    return {k: v for k, v in row.items() if v is not None and k not in WALL_CLOCK_KEYS}
