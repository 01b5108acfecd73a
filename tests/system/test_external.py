"""An autopilot that simulates its own flight, in our world: processes that only speak MAVLink."""

import re
import subprocess
from pathlib import Path

import pytest

from tests.system.processes import companion, free_udp_port, read_until, sitl, started, stop
from tests.system.scoring import assert_good

SPEED = "1"
SETTINGS = "[link]\nsetpoint_loss_s = 5"
"""A busy machine may pause a process for longer than a drone may fly without setpoints."""
DEADLINE_S = 200
ROOM = """
name = "small"
height_m = 2.6
[[walls]]
points = [[0, 0], [6, 0], [6, 5], [0, 5]]
closed = true
[[starts]]
name = "middle"
position = [3.2, 2.2]
"""


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_mission_with_an_autopilot_elsewhere(autopilot: str, tmp_path: Path) -> None:
    world, truth = tmp_path / "small.toml", tmp_path / "truth.json"
    world.write_text(ROOM)
    settings = tmp_path / "drone.toml"
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
        fly = companion("fly", "--link", f"udpin:{for_companion}", "--bus", bus)
        with started([*fly, "--config", str(settings), "--out", str(tmp_path)]) as pilot:
            output, _ = pilot.communicate(timeout=DEADLINE_S)
        assert pilot.returncode == 0, output
        stop(ours)
    assert_good(tmp_path / "map.json", truth, str(world))
    scored = subprocess.run(
        sitl("score", str(world), str(tmp_path / "map.json"), str(truth)),
        check=True,
        capture_output=True,
        text=True,
    )
    assert re.search(r"coverage\s+│\s+(9|100)", scored.stdout)
