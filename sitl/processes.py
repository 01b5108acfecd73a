"""One flight in two processes, as on a real drone: `sitl run` and `companion fly`.

They meet only over MAVLink on UDP and the served bus on TCP; the truth stays with SITL, which
writes it for the scorer when it ends.
"""

import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from companion.mapping.files import load_json
from companion.messages import FloorPlan
from sitl.errors import SitlError
from sitl.record import TruthRecord

END_TIMEOUT_S = 20.0
TRUTH_FILE = "truth.json"


def fly_in_two_processes(
    sitl_arguments: Sequence[str], companion_arguments: Sequence[str], out: Path
) -> tuple[FloorPlan, TruthRecord, int]:
    """Fly; the map, the truth, and the companion's exit status."""
    out.mkdir(parents=True, exist_ok=True)
    truth_path = out / TRUTH_FILE
    sitl = subprocess.Popen(
        [
            *(sys.executable, "-m", "sitl", "run", *sitl_arguments),
            *(
                "--mavlink",
                "udpin:127.0.0.1:0",
                "--bus-port",
                "0",
                "--lockstep",
                "--truth",
                str(truth_path),
            ),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert sitl.stdout is not None
        mavlink_port, bus_port = _ports(sitl.stdout)
        companion = subprocess.run(
            [
                *(sys.executable, "-m", "companion", "fly", *companion_arguments),
                *("--link", f"udpout:127.0.0.1:{mavlink_port}"),
                *("--bus", f"sitl://127.0.0.1:{bus_port}", "--out", str(out)),
            ],
            check=False,
        )
    finally:
        sitl.send_signal(signal.SIGINT)
        sitl.wait(END_TIMEOUT_S)
    return load_json(out / "map.json"), TruthRecord.load(truth_path), companion.returncode


def _ports(output: IO[str]) -> tuple[str, str]:
    """The MAVLink and bus ports that `sitl run` prints once it serves them."""
    seen = ""
    for line in output:
        seen += line
        ports = re.search(r"udpin:127\.0\.0\.1:(\d+).*sitl://127\.0\.0\.1:(\d+)", seen, re.DOTALL)
        if ports:
            return ports[1], ports[2]
    raise SitlError("sitl run ended before it served anything")
