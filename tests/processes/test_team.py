"""Tests teams of companion processes in one simulated world, which talk over Zenoh."""

import json
import math
import os
import re
import signal
import tomllib
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue

import pytest

from companion.config.team import TeamConfig
from companion.core.errors import ViewError
from companion.core.frames import Vector2
from companion.recording.reader import read
from companion.team.messages import MapPiece, decode
from companion.view.feed_client import FeedClient, parse_address
from companion.view.snapshot import Snapshot
from tests.processes.lossy_radio import lossy_radio
from tests.processes.started import free_tcp_port, pilot, read_until, sitl, started, stop
from tests.waiting import DEADLINE_S, until
from tests.worlds import ROOM

WORLD = """
name = "one room"
height_m = 2.6
walls = [{ points = [[0, 0], [8, 0], [8, 7], [0, 7]], closed = true }]
starts = [{ name = "left", position = [4, 2.5], heading_deg = 0 }]
"""
SPEED = "8"
"""Times real time. The radio between the processes runs in real time: a delay of 10 ms is 80 ms of
the flight."""
LOSS = 0.3
MIN_APART_M = 0.6


def test_two_companions_trace_a_room_together_over_a_bad_radio(tmp_path: Path) -> None:
    world, truth = tmp_path / "room.toml", tmp_path / "truth.json"
    world.write_text(WORLD)
    links = ("--team", "2", "--mavlink", "udpin:127.0.0.1:0", "--bus-port", "0")
    pace = ("--lockstep", "--speed", SPEED, "--truth", str(truth))
    with started(sitl("run", str(world), *links, *pace)) as vehicles:
        output = "".join(read_until(vehicles, "sitl://") for _ in range(2))
        pads = tomllib.loads(re.findall(r"pads = .*", output)[0])["pads"]
        assert len(pads) == 2
        found = re.findall(r"127\.0\.0\.1:(\d+)  system \d", output)
        with lossy_radio(TeamConfig(name="pair", pads=pads), LOSS) as radio:
            first, second = (team.model_dump() for team in radio.teams)
            view = {"listen": f"127.0.0.1:{free_tcp_port()}"}
            one = pilot(1, found[0], found[1], tmp_path, team=first, view=view)
            other = pilot(2, found[2], found[3], tmp_path, team=second)
            with started(one) as one_flies, started(other) as other_flies:
                assert seen_from(view["listen"]) == pytest.approx((0.0, 2.0), abs=0.5)
                for flying in (one_flies, other_flies):
                    output, _ = flying.communicate(timeout=DEADLINE_S)
                    assert flying.returncode == 0, output
                    assert "mission complete" in output or "landed" in output
        assert radio.carried > 500
        assert radio.loss == pytest.approx(LOSS, abs=0.05)
        stop(vehicles)
    walls_m = []
    for number in (1, 2):
        plan = json.loads((tmp_path / f"out_{number}" / "map.json").read_text())
        ends = ((wall["start_ne_m"], wall["end_ne_m"]) for wall in plan["walls"])
        walls_m.append(sum(math.dist(start, end) for start, end in ends))
        flown = json.loads((truth if number == 1 else tmp_path / "truth_2.json").read_text())
        assert flown["collisions"] == 0
        assert flown["apart_m"] > MIN_APART_M
    assert sum(walls_m) > 27, "both together have seen the walls of 30 m"
    assert min(walls_m) < 29, "neither has traced the whole room"
    for recording in tmp_path.glob("out_*/*.mcap"):
        heard = pieces_heard(recording)
        assert len(heard) > 8, "most of what the other has seen in half a minute"
        assert set(range(max(heard) - 2)) <= heard, "only the last may be missing"


def pieces_heard(recording: Path) -> set[int]:
    """Numbers of the pieces of the other's map that a drone has received."""
    packets = (packet for tick in read(recording).ticks for packet in tick.inputs.team)
    bodies = (decode(packet).body for packet in packets)
    return {body.number for body in bodies if isinstance(body, MapPiece)}


def fly_team(folder: Path) -> list[str]:
    world = folder / "room.toml"
    world.write_text(ROOM)
    files = ("--transport", "udp", "--out", str(folder / "out"))
    return sitl("fly", str(world), "--team", "2", *files)


def processes_of(parent: int) -> dict[int, str]:
    """Command lines of the processes that a process has started, by their number."""
    numbers = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    return {int(each): Path(f"/proc/{each}/cmdline").read_text() for each in numbers}


def test_a_companion_that_crashes_is_a_row_and_the_other_maps_the_room(tmp_path: Path) -> None:
    with started(fly_team(tmp_path)) as flight:
        read_until(flight, "turning 360")
        [second] = [each for each, line in processes_of(flight.pid).items() if "drone_2" in line]
        os.kill(second, signal.SIGKILL)
        output, _ = flight.communicate(timeout=DEADLINE_S)
        assert flight.returncode == 1, output
    report = json.loads((tmp_path / "out/report.json").read_text())
    assert not report["completed"]
    assert report["collisions"] == 0
    assert report["coverage"] > 0.95
    assert report["apart_m"] > MIN_APART_M
    first, crashed = report["drones"]
    assert first["completed"], first["ending"]
    assert first["radio_bytes_s"] > 500
    assert not crashed["completed"]
    assert crashed["ending"].startswith(f"the companion crashed with exit status {-signal.SIGKILL}")


def test_ctrl_c_ends_all_processes(tmp_path: Path) -> None:
    with started(fly_team(tmp_path)) as flight:
        read_until(flight, "waiting for gyro rest")
        processes = processes_of(flight.pid)
        assert len(processes) == 3
        stop(flight)
        assert flight.returncode != 0
    until(lambda: not any(map(is_running, processes)), "the end of all processes")


def is_running(process: int) -> bool:
    return Path(f"/proc/{process}").exists()


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
