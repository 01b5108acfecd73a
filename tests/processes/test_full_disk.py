"""Tests that a flight continues when disk or terminal cannot be written any more."""

import fcntl
import json
import os
import resource
import signal
import subprocess
from pathlib import Path

from companion.recording.reader import read
from companion.run.unattended import EXIT_ENDED
from tests.processes.started import companion, flying, read_until, running_sitl
from tests.waiting import DEADLINE_S
from tests.worlds import SMALL_ROOM

LARGEST_FILE = 400_000
"""File size limit, bytes: half a minute of recording, and any map."""


def test_the_flight_continues_when_the_recording_cannot_grow(tmp_path: Path) -> None:
    with running_sitl("--speed", "1000", world=SMALL_ROOM) as (_, mavlink_port, bus_port):
        pilot = flying(mavlink_port, bus_port, tmp_path)
        read_until(pilot, "waiting")
        resource.prlimit(pilot.pid, resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))
        output, _ = pilot.communicate(timeout=DEADLINE_S)
    assert pilot.returncode == 0, output
    assert output.count("recording stopped") == 1
    assert json.loads((tmp_path / "map.json").read_text())["walls"]
    (recording,) = tmp_path.glob("*.mcap")
    assert len(read(recording).ticks) > 0


def test_a_closed_terminal_does_not_end_the_flight(tmp_path: Path) -> None:
    with running_sitl("--speed", "1000", world=SMALL_ROOM) as (_, mavlink_port, bus_port):
        pilot = flying(mavlink_port, bus_port, tmp_path)
        read_until(pilot, "waiting")
        assert pilot.stdout is not None
        pilot.stdout.close()
        pilot.send_signal(signal.SIGHUP)
        status = pilot.wait(DEADLINE_S)
    assert status == 0
    assert json.loads((tmp_path / "map.json").read_text())["walls"]


def test_a_blocked_output_does_not_block_the_flight(tmp_path: Path) -> None:
    """The output blocks, like a terminal after Ctrl-S or a log that cannot be written."""
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)
    os.write(writing, b"." * 4096)
    with running_sitl("--speed", "1000", world=SMALL_ROOM) as (_, mavlink_port, bus_port):
        link = ("--link", f"udpout:127.0.0.1:{mavlink_port}")
        bus = ("--bus", f"sitl://127.0.0.1:{bus_port}", "--out", str(tmp_path))
        pilot = subprocess.Popen(companion("fly", *link, *bus), stdout=writing)
        try:
            status = pilot.wait(DEADLINE_S)
        finally:
            pilot.kill()
            pilot.wait(DEADLINE_S)
    os.close(reading)
    os.close(writing)
    assert status == 0
    assert json.loads((tmp_path / "map.json").read_text())["walls"]


def test_an_unwritable_map_is_reported_with_its_own_exit_status(tmp_path: Path) -> None:
    """The drone has landed, so systemd must not start a recovery."""
    for name in ("map.json", "map.png", "map.ply"):
        (tmp_path / f".unfinished-{name}").symlink_to("/dev/full")
    with running_sitl("--speed", "1000", world=SMALL_ROOM) as (_, mavlink_port, bus_port):
        pilot = flying(mavlink_port, bus_port, tmp_path)
        output, _ = pilot.communicate(timeout=DEADLINE_S)
    assert pilot.returncode == EXIT_ENDED, output
    assert "mission complete" in output
    assert output.count("the map so far is not saved") == 1
    assert "the map is not saved" in output
    assert "No space left" in output
