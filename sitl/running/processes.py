"""Flies in several processes, as on real drones: `sitl run`, and a `companion fly` for each drone.

They connect only by MAVLink on UDP, the served bus on TCP, and the radio of a team. The ground
truth stays with SITL, which writes it for the scorer at the end.
"""

import math
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.messages import FloorPlan
from companion.export.map_files import load_json
from sitl.core.errors import SitlError
from sitl.simulation.record import TruthRecord, truth_files

END_TIMEOUT_S = 20.0
"""Time for `sitl run` to end after SIGINT, s. Chosen."""
LOOK_S = 0.1
"""Interval at which ended companions are looked for, s. Chosen."""
TRUTH_FILE = "truth.json"
CONFIG_FILE = "config.toml"
SERVE_LOCKSTEP = ("--mavlink=udpin:127.0.0.1:0", "--bus-port=0", "--lockstep")
"""Options of `sitl run` for free ports and lockstep."""


@dataclass(frozen=True, slots=True)
class Ended:
    """What the processes of a flight leave beside the companions' files."""

    truths: tuple[TruthRecord, ...]
    statuses: tuple[int, ...]
    """Exit status of each companion; negative: the signal that ended it."""
    flying_s: float
    """Wall time from the companions' first clock request to their last, s."""


@dataclass(frozen=True, slots=True)
class TwoProcessFlight:
    """Results of a flight in two processes."""

    plan: FloorPlan
    truth: TruthRecord
    completed: bool
    flying_s: float
    """Wall time from the companion's first clock request to its last, s."""

    @property
    def ending(self) -> str:
        return "mission complete" if self.completed else "mission not completed"


def fly_in_two_processes(
    sitl_arguments: Sequence[str], settings: Config, out: Path, *, quiet: bool = False
) -> TwoProcessFlight:
    """Fly; the companion's effective configuration is also written to `out`."""
    ended = fly_in_processes(sitl_arguments, {out: settings}, out / TRUTH_FILE, quiet=quiet)
    return TwoProcessFlight(
        load_json(out / "map.json"), ended.truths[0], ended.statuses[0] == 0, ended.flying_s
    )


def fly_in_processes(
    sitl_arguments: Sequence[str],
    companions: Mapping[Path, Config],
    truth_path: Path,
    *,
    quiet: bool = False,
) -> Ended:
    """Fly until the last companion has ended; an exception, such as Ctrl-C, ends all processes.

    Args:
        sitl_arguments: of `sitl run`, which serves a vehicle for each companion.
        companions: the configuration of each companion, by the folder for its files.
        truth_path: file for the true flight of the first vehicle.
        quiet: prints no progress; it is that of the first companion.

    Raises:
        SitlError: `sitl run` ended before it was ready.
    """
    for out, config in companions.items():
        out.mkdir(parents=True, exist_ok=True)
        (out / CONFIG_FILE).write_text(configuration.to_toml(config), encoding="utf-8")
    command = [sys.executable, "-m", "sitl", "run", *sitl_arguments, *SERVE_LOCKSTEP]
    signing_key = next(iter(companions.values())).link.signing_key
    if signing_key is not None:
        command.append(f"--signing-key={signing_key}")
    command.append(f"--truth={truth_path}")
    sitl = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, errors="replace")
    flying: dict[subprocess.Popen[bytes], str] = {}
    try:
        assert sitl.stdout is not None
        for out, (mavlink_port, bus_port) in zip(
            companions, ports(sitl.stdout, len(companions)), strict=True
        ):
            companion = subprocess.Popen(
                [
                    *(sys.executable, "-m", "companion", "fly", f"--config={out / CONFIG_FILE}"),
                    *("--link", f"udpout:127.0.0.1:{mavlink_port}"),
                    *("--bus", f"sitl://127.0.0.1:{bus_port}", "--out", str(out)),
                ],
                stdout=subprocess.DEVNULL if quiet or flying else None,
            )
            flying[companion] = bus_port
        _await(flying)
    finally:
        for companion in flying:
            companion.kill()
            companion.wait()
        sitl.send_signal(signal.SIGINT)
        rest, _ = sitl.communicate(timeout=END_TIMEOUT_S)
    attended = re.search(r"attended ([\d.]+) s", rest)
    return Ended(
        tuple(map(TruthRecord.load, truth_files(truth_path, len(companions)))),
        tuple(companion.returncode for companion in flying),
        float(attended[1]) if attended else math.nan,
    )


def _await(flying: Mapping["subprocess.Popen[bytes]", str]) -> None:
    """Wait for the companions.

    A connection that ends tells `sitl run` not to wait for a companion that ended before it
    connected.
    """
    remaining = dict(flying)
    while remaining:
        for companion in [each for each in remaining if each.poll() is not None]:
            with suppress(OSError):  # sitl has ended, too
                socket.create_connection(("127.0.0.1", int(remaining[companion]))).close()
            del remaining[companion]
        time.sleep(LOOK_S)


def ports(output: IO[str], vehicles: int = 1) -> list[tuple[str, str]]:
    """The MAVLink and bus ports of each vehicle that `sitl run` prints when it is ready."""
    seen = ""
    for line in output:
        seen += line
        found = re.findall(r"udpin:127\.0\.0\.1:(\d+).*?sitl://127\.0\.0\.1:(\d+)", seen, re.DOTALL)
        if len(found) == vehicles:
            return found
    raise SitlError("sitl run ended before it was ready")
