"""Flies in two processes, as on a real drone: `sitl run` and `companion fly`.

They connect only by MAVLink on UDP and the served bus on TCP. The ground truth stays with SITL,
which writes it for the scorer at the end.
"""

import math
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.messages import FloorPlan
from companion.export.map_files import load_json
from sitl.core.errors import SitlError
from sitl.simulation.record import TruthRecord

END_TIMEOUT_S = 20.0
"""Time for `sitl run` to end after SIGINT, s. Chosen."""
TRUTH_FILE = "truth.json"
CONFIG_FILE = "config.toml"
SERVE_LOCKSTEP = ("--mavlink=udpin:127.0.0.1:0", "--bus-port=0", "--lockstep")
"""Options of `sitl run` for free ports and lockstep."""


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
    out.mkdir(parents=True, exist_ok=True)
    truth_path, config_path = out / TRUTH_FILE, out / CONFIG_FILE
    config_path.write_text(configuration.to_toml(settings), encoding="utf-8")
    command = [sys.executable, "-m", "sitl", "run", *sitl_arguments, *SERVE_LOCKSTEP]
    if settings.link.signing_key is not None:
        command.append(f"--signing-key={settings.link.signing_key}")
    command.append(f"--truth={truth_path}")
    sitl = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, errors="replace")
    try:
        assert sitl.stdout is not None
        mavlink_port, bus_port = ports(sitl.stdout)
        companion = subprocess.run(
            [
                *(sys.executable, "-m", "companion", "fly", f"--config={config_path}"),
                *("--link", f"udpout:127.0.0.1:{mavlink_port}"),
                *("--bus", f"sitl://127.0.0.1:{bus_port}", "--out", str(out)),
            ],
            stdout=subprocess.DEVNULL if quiet else None,
            check=False,
        )
    finally:
        sitl.send_signal(signal.SIGINT)
        rest, _ = sitl.communicate(timeout=END_TIMEOUT_S)
    attended = re.search(r"attended ([\d.]+) s", rest)
    return TwoProcessFlight(
        load_json(out / "map.json"),
        TruthRecord.load(truth_path),
        companion.returncode == 0,
        float(attended[1]) if attended else math.nan,
    )


def ports(output: IO[str]) -> tuple[str, str]:
    """The MAVLink and bus ports that `sitl run` prints when it is ready."""
    seen = ""
    for line in output:
        seen += line
        ports = re.search(r"udpin:127\.0\.0\.1:(\d+).*sitl://127\.0\.0\.1:(\d+)", seen, re.DOTALL)
        if ports:
            return ports[1], ports[2]
    raise SitlError("sitl run ended before it was ready")
