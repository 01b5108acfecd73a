"""A campaign that somebody ends before it is over."""

import json
import subprocess

from tests.system.processes import sitl

SEEDS = 40
ENDS_WITHIN_S = 120


def test_what_was_flown_by_then_is_not_lost() -> None:
    command = sitl("bench", "missions", "--worlds", "room_100", "--seeds", str(SEEDS), "--json")
    campaign = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert campaign.stderr is not None
        assert campaign.stderr.readline().startswith("1 of ")
        campaign.terminate()
        told, _ = campaign.communicate(timeout=ENDS_WITHIN_S)
    finally:
        campaign.kill()
    assert 0 < len(json.loads(told)["rows"]) < SEEDS
