"""Tests a team of two companion processes over Zenoh, in one simulated world."""

import json
import math
import re
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue

import pytest

from companion.core.errors import ViewError
from companion.core.frames import Vector2
from companion.view.feed_client import FeedClient, parse_address
from companion.view.snapshot import Snapshot
from tests.processes.started import free_tcp_port, pilot, read_until, sitl, started, stop
from tests.waiting import DEADLINE_S, until

WORLD = """
name = "one room"
height_m = 2.6
walls = [{ points = [[0, 0], [8, 0], [8, 7], [0, 7]], closed = true }]
starts = [
  { name = "left", position = [4, 2.5], heading_deg = 0 },
  { name = "right", position = [4, 4.5], heading_deg = 0 },
]
"""
SPEED = "4"
"""Times real time. The radio between the processes runs in real time: a delay of 50 ms is 0.2 s of
the flight."""
PADS = [{}, {"east_m": 2.0}]


def test_two_companions_trace_a_room_together(tmp_path: Path) -> None:
    world, truth = tmp_path / "room.toml", tmp_path / "truth.json"
    world.write_text(WORLD)
    links = ("--vehicles", "2", "--mavlink", "udpin:127.0.0.1:0", "--bus-port", "0")
    pace = ("--lockstep", "--speed", SPEED, "--truth", str(truth))
    addresses = [f"127.0.0.1:{free_tcp_port()}" for _ in PADS]
    team = {"name": "pair", "pads": PADS, "addresses": addresses}
    with started(sitl("run", str(world), *links, *pace)) as vehicles:
        output = "".join(read_until(vehicles, "sitl://") for _ in PADS)
        found = re.findall(r"127\.0\.0\.1:(\d+)  system \d", output)
        view = {"listen": f"127.0.0.1:{free_tcp_port()}"}
        first = pilot(1, found[0], found[1], tmp_path, team=team | {"drone": 1}, view=view)
        second = pilot(2, found[2], found[3], tmp_path, team=team | {"drone": 2})
        with started(first) as one, started(second) as other:
            assert seen_from(view["listen"]) == pytest.approx((0.0, 2.0), abs=0.5)
            for flying in (one, other):
                output, _ = flying.communicate(timeout=DEADLINE_S)
                assert flying.returncode == 0, output
                assert "mission complete" in output or "landed" in output
        stop(vehicles)
    walls_m = []
    for number in (1, 2):
        plan = json.loads((tmp_path / f"out_{number}" / "map.json").read_text())
        ends = ((wall["start_ne_m"], wall["end_ne_m"]) for wall in plan["walls"])
        walls_m.append(sum(math.dist(start, end) for start, end in ends))
        flown = json.loads((truth if number == 1 else tmp_path / "truth_2.json").read_text())
        assert flown["collisions"] == 0
    assert sum(walls_m) > 27, "both together have seen the walls of 30 m"
    assert min(walls_m) < 29, "neither has traced the whole room"


def seen_from(drone: str) -> Vector2:
    """Where a viewer of the first drone sees the second one first."""
    seen: SimpleQueue[Snapshot] = SimpleQueue()
    viewer: list[FeedClient] = []

    def is_open() -> bool:
        with suppress(ViewError):
            viewer.append(FeedClient(parse_address(drone), "", seen.put, lambda reason: None))
        return bool(viewer)

    until(is_open, "the feed")
    while not (mates := seen.get(timeout=DEADLINE_S).mates):
        continue
    viewer[0].close()
    [mate] = mates
    assert mate.drone == 2
    return mate.ne_m
