"""Tests two drones in one world, each with its own companion process."""

import re
from pathlib import Path

from tests.processes.scoring import assert_good
from tests.processes.started import pilot, read_until, sitl, started, stop
from tests.waiting import DEADLINE_S

WORLD = """
name = "neighbours"
height_m = 2.6
[[walls]]
points = [[0, 0], [4.5, 0], [4.5, 4], [0, 4]]
closed = true
[[walls]]
points = [[20, 0], [24, 0], [24, 5], [20, 5]]
closed = true
[[starts]]
name = "north"
position = [2.4, 1.8]
[[starts]]
name = "south"
position = [21.8, 2.9]
"""


def test_two_vehicles_complete_their_missions_at_once(tmp_path: Path) -> None:
    world, truth = tmp_path / "neighbours.toml", tmp_path / "truth.json"
    world.write_text(WORLD)
    links = ("--vehicles", "2", "--mavlink", "udpin:127.0.0.1:0", "--bus-port", "0")
    pace = ("--lockstep", "--speed", "1000", "--truth", str(truth))
    with started(sitl("run", str(world), *links, *pace)) as vehicles:
        output = "".join(read_until(vehicles, "sitl://") for _ in range(2))
        ports = re.findall(r"127\.0\.0\.1:(\d+)  system (\d)", output)
        assert [system for _, system in ports] == ["1", "1", "2", "2"]
        first = pilot(1, ports[0][0], ports[1][0], tmp_path)
        second = pilot(2, ports[2][0], ports[3][0], tmp_path)
        with started(first) as one, started(second) as other:
            for flying in (one, other):
                output, _ = flying.communicate(timeout=DEADLINE_S)
                assert flying.returncode == 0, output
        stop(vehicles)
    assert_good(tmp_path / "out_1/map.json", truth, str(world))
    assert_good(tmp_path / "out_2/map.json", tmp_path / "truth_2.json", str(world), start=1)
