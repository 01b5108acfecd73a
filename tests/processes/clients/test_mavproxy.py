"""Tests with MAVProxy as client: it detects the vehicle, reads parameters, changes modes, arms.

MAVProxy first requests the parameters as a file. There is none, so it must fall back to a list.
"""

import os
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from sitl.autopilot.parameters.table import load_table
from tests.processes.started import free_udp_port, vehicle_at
from tests.waiting import DEADLINE_S, PAUSE, until

SCRIPT = Path(sysconfig.get_path("scripts")) / "mavproxy.py"
CHANGE_MODE = {"ardupilot": ("mode GUIDED", "Mode GUIDED"), "px4": ("long 176 1 3", "Mode POSCTL")}
"""Mode by number for PX4: MAVProxy 1.8 does not handle the names of its modes."""

ORIGIN = "message SET_GPS_GLOBAL_ORIGIN 1 473977000 85456000 488000 0"


class MavProxy:
    """A session; its output goes to a file, so that reading never blocks."""

    def __init__(self, port: int, folder: Path) -> None:
        self._output = folder / "mavproxy.log"
        with self._output.open("w") as output:
            self._process = subprocess.Popen(
                [
                    *(sys.executable, str(SCRIPT), "--master", f"udpin:127.0.0.1:{port}"),
                    *("--state-basedir", str(folder), "--load-module", "message"),
                ],
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=subprocess.STDOUT,
                text=True,
                env={**os.environ, "HOME": str(folder), "PYTHONUNBUFFERED": "1"},
            )

    def types(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()

    def has_printed(self, words: str) -> bool:
        """True if the text is printed at the beginning of a line, or behind the prompt."""
        printed = self._output.read_text(errors="replace")
        return words in printed or words.replace("\n", "> ", 1) in printed

    def prints(self, words: str) -> None:
        until(lambda: self.has_printed(words), f"MAVProxy's {words!r}")

    def insists(self, line: str, words: str) -> None:
        """Type the line once a second until this answer: the estimator must settle first."""
        end_s = time.monotonic() + DEADLINE_S
        while not self.has_printed(words):
            assert time.monotonic() < end_s, f"MAVProxy's {words!r} not within {DEADLINE_S} s"
            self.types(line)
            PAUSE.wait(1.0)

    def quits(self) -> None:
        """End its input."""
        self._process.communicate(timeout=DEADLINE_S)

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate(timeout=DEADLINE_S)


@pytest.fixture(params=["ardupilot", "px4"])
def firmware(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def mavproxy(firmware: str, tmp_path: Path) -> Iterator[MavProxy]:
    port = free_udp_port()
    with vehicle_at(port, firmware):
        session = MavProxy(port, tmp_path)
        try:
            yield session
        finally:
            session.kill()


def test_mavproxy_connects_reads_parameters_changes_mode_and_arms(
    mavproxy: MavProxy, firmware: str, tmp_path: Path
) -> None:
    mavproxy.prints("Detected vehicle 1:1")
    mavproxy.prints(f"Received {len(load_table(firmware))} parameters\n")
    mavproxy.types(f"param save {tmp_path / 'all.parm'}")
    until((tmp_path / "all.parm").exists, "the parameters' file")
    command, answer = CHANGE_MODE[firmware]
    mavproxy.types(command)
    mavproxy.prints(answer)
    if firmware == "ardupilot":
        mavproxy.insists(ORIGIN, "EKF3 IMU0 origin set")
        assert not mavproxy.has_printed("fence breach")
    mavproxy.insists("arm throttle", "\nARMED")
    mavproxy.types("disarm")
    mavproxy.prints("\nDISARMED")
    mavproxy.quits()
    names = {line.split()[0] for line in (tmp_path / "all.parm").read_text().splitlines()}
    assert names - {"_HASH_CHECK"} == set(load_table(firmware))
