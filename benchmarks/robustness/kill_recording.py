"""Kills the companion in flight, many times: `python -m benchmarks.robustness.kill_recording`.

Prints the figures on crashes of docs/recording.md. Each time `companion fly` gets SIGKILL at a
random moment. `sitl run`, whose time stops without a companion, records that moment. The loss is
the time since the last recorded tick. The file must open unchanged in the MCAP project's reader and
in the companion's, the tlog in pymavlink's.
"""

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from mcap.reader import make_reader
from pymavlink import mavutil

from companion.recording.reader import read
from companion.recording.replay import replay
from sitl.running.processes import END_TIMEOUT_S, SERVE_LOCKSTEP, ports
from sitl.simulation.record import TruthRecord

WORLD = "room_100"
OPEN_TIMEOUT_S = 60.0


@dataclass(frozen=True, slots=True)
class Killed:
    """Result of one killed flight."""

    at_s: float
    """Time of the kill in the flight, s."""
    lost_s: float
    """Lost time, wall time, s."""
    messages: int
    """Messages that the MCAP project's reader found."""
    packets: int
    """Packets that pymavlink found in the tlog."""
    walls: int
    """Walls on the map from a replay."""


def kill_a_flight(folder: Path, after_s: float, speed: float) -> Killed:
    """Fly, kill `after_s` of wall time after the start of the recording, and read the files."""
    truth = folder / "truth.json"
    command = [sys.executable, "-m", "sitl", "run", WORLD, f"--speed={speed}", *SERVE_LOCKSTEP]
    sitl = subprocess.Popen([*command, f"--truth={truth}"], stdout=subprocess.PIPE, text=True)
    try:
        assert sitl.stdout is not None
        [(mavlink_port, bus_port)] = ports(sitl.stdout)
        companion = subprocess.Popen(
            [
                *(sys.executable, "-m", "companion", "fly", f"--out={folder}"),
                *(f"--link=udpout:127.0.0.1:{mavlink_port}", f"--bus=sitl://127.0.0.1:{bus_port}"),
            ],
            stdout=subprocess.DEVNULL,
        )
        _await_recording(folder)
        time.sleep(after_s)
        companion.kill()
        companion.wait()
    finally:
        sitl.send_signal(signal.SIGINT)
        sitl.communicate(timeout=END_TIMEOUT_S)
    return _read_files(folder, TruthRecord.load(truth).path[-1].time_s, speed)


def _await_recording(folder: Path) -> None:
    deadline_s = time.monotonic() + OPEN_TIMEOUT_S
    while not any(path.stat().st_size for path in folder.glob("*.mcap")):
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"no recording in {folder}")
        time.sleep(0.01)


def _read_files(folder: Path, killed_s: float, speed: float) -> Killed:
    (path,) = folder.glob("*.mcap")
    with path.open("rb") as file:
        messages = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())
    tlog = mavutil.mavlink_connection(str(path.with_suffix(".tlog")))
    packets = 0
    while tlog.recv_match() is not None:
        packets += 1
    tlog.close()
    recording = read(path)
    lost_s = (killed_s - recording.ticks[-1].now_s) / speed if recording.ticks else killed_s / speed
    walls = len(replay(recording).final_floor_plan().walls)
    return Killed(killed_s, lost_s, messages, packets, walls)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--speed", type=float, default=1.0, help="speed, times real time")
    parser.add_argument("--within", type=float, default=12.0, help="latest kill after the start, s")
    parser.add_argument("--seed", type=int, default=1, help="seed of the moments")
    options = parser.parse_args()
    moments = random.Random(options.seed)
    killed = []
    for number in range(options.kills):
        after_s = moments.uniform(0.0, options.within)
        with tempfile.TemporaryDirectory() as folder:
            one = kill_a_flight(Path(folder), after_s, options.speed)
        killed.append(one)
        print(
            f"{number + 1:3}  killed at {one.at_s:5.1f} s, lost {one.lost_s:.2f} s; "
            f"{one.messages} messages, {one.packets} packets, {one.walls} walls by replay",
            flush=True,
        )
    print(
        f"{len(killed)} kills at {options.speed:g} × real time: every file opened; "
        f"lost at most {max(one.lost_s for one in killed):.2f} s, "
        f"{sum(one.lost_s for one in killed) / len(killed):.2f} s on average"
    )


if __name__ == "__main__":
    main()
