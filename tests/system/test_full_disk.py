"""A disk on which nothing more can be written in the middle of a flight."""

import json
import resource
from pathlib import Path

from companion.recording.reader import read
from tests.system.processes import flying, read_until, running_sitl

DEADLINE_S = 120
LARGEST_FILE = 400_000
"""Bytes: half a minute of recording, and any map."""


def test_the_recording_ends_and_the_flight_goes_on(tmp_path: Path) -> None:
    with running_sitl("--speed", "1000") as (_, mavlink_port, bus_port):
        pilot = flying(mavlink_port, bus_port, tmp_path)
        read_until(pilot, "waiting")
        resource.prlimit(pilot.pid, resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))
        output, _ = pilot.communicate(timeout=DEADLINE_S)
    assert pilot.returncode == 0, output
    assert output.count("recording stopped") == 1
    assert json.loads((tmp_path / "map.json").read_text())["walls"]
    (recording,) = tmp_path.glob("*.mcap")
    assert len(read(recording).ticks) > 0
