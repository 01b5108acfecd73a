"""Tests an autopilot that simulates its own flight: processes connected only by MAVLink."""

import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.processes.scoring import assert_good
from tests.processes.started import companion, free_udp_port, read_until, sitl, started, stop
from tests.waiting import DEADLINE_S

SPEED = "1"
SETTINGS = "[link]\nsetpoint_loss_s = 5"
"""Longer timeout: a busy machine may pause a process for longer than the default."""

ROOM = """
name = "small"
height_m = 2.6
[[walls]]
points = [[0, 0], [4.5, 0], [4.5, 4], [0, 4]]
closed = true
[[starts]]
name = "middle"
position = [2.4, 1.8]
"""


def test_a_mission_with_an_external_autopilot_completes(tmp_path: Path) -> None:
    """The missions run in parallel in real time, which needs little processor time."""
    with ThreadPoolExecutor() as pool:
        flights = [pool.submit(flies, kind, tmp_path / kind) for kind in ("ardupilot", "px4")]
    for flight in flights:
        flight.result()


def flies(autopilot: str, folder: Path) -> None:
    folder.mkdir()
    world, truth = folder / "small.toml", folder / "truth.json"
    world.write_text(ROOM)
    settings = folder / "drone.toml"
    settings.write_text(SETTINGS)
    for_world, for_companion = (f"127.0.0.1:{free_udp_port()}" for _ in range(2))
    bare = sitl("autopilot", "--autopilot", autopilot, "--speed", SPEED)
    links = ("--mavlink", f"udpout:{for_world}", "--mavlink", f"udpout:{for_companion}")
    served = sitl("run", str(world), "--autopilot", "external", "--connect", f"udpin:{for_world}")
    with (
        started([*bare, *links]),
        started([*served, "--bus-port", "0", "--truth", str(truth)]) as ours,
    ):
        bus = re.findall(r"sitl://\S+", read_until(ours, "sitl://"))[0]
        read_until(ours, "parameters set")
        command = companion("fly", "--link", f"udpin:{for_companion}", "--bus", bus)
        with started([*command, "--config", str(settings), "--out", str(folder)]) as pilot:
            output, _ = pilot.communicate(timeout=DEADLINE_S)
        assert pilot.returncode == 0, output
        stop(ours)
    assert_good(folder / "map.json", truth, str(world))
    scored = subprocess.run(
        sitl("score", str(world), str(folder / "map.json"), str(truth)),
        check=True,
        capture_output=True,
        text=True,
    )
    assert re.search(r"coverage\s+│\s+(9|100)", scored.stdout)
