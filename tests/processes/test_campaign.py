"""Tests a campaign that is interrupted."""

import json
import subprocess

from tests.processes.started import sitl
from tests.waiting import DEADLINE_S
from tests.worlds import SMALL_ROOM

SEEDS = 40
MISSIONS = ("missions", "--worlds", SMALL_ROOM, "--seeds", str(SEEDS), "--battery-s", "60")


def test_an_interrupted_campaign_reports_its_finished_flights() -> None:
    command = sitl("bench", *MISSIONS, "--json")
    flying = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert flying.stderr is not None
        assert flying.stderr.readline().startswith("1 of ")
        flying.terminate()
        output, _ = flying.communicate(timeout=DEADLINE_S)
    finally:
        flying.kill()
    assert 0 < len(json.loads(output)["rows"]) < SEEDS
