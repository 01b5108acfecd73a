"""A client that is not ours: MAVProxy finds the vehicle, reads its parameters, changes modes, arms.

It asks for parameters as a file first; there is none, and it has to fall back to a list.
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
from tests.processes.started import PAUSE, free_udp_port, until, vehicle_at

DEADLINE_S = 60
SCRIPT = Path(sysconfig.get_path("scripts")) / "mavproxy.py"
CHANGE_MODE = {"ardupilot": ("mode GUIDED", "Mode GUIDED"), "px4": ("long 176 1 3", "Mode POSCTL")}
"""By number for PX4: MAVProxy 1.8 trips over the names of its modes."""

ORIGIN = "message SET_GPS_GLOBAL_ORIGIN 1 473977000 85456000 488000 0"


class MavProxy:
    """A session; what it prints goes to a file, so that reading it never waits."""

    def __init__(self, port: int, folder: Path) -> None:
        self._said = folder / "mavproxy.log"
        with self._said.open("w") as output:
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

    def has_said(self, words: str) -> bool:
        """At a line's begin, or behind the prompt if that was written first."""
        said = self._said.read_text(errors="replace")
        return words in said or words.replace("\n", "> ", 1) in said

    def says(self, words: str) -> None:
        until(lambda: self.has_said(words), f"MAVProxy's {words!r}", DEADLINE_S)

    def insists(self, line: str, words: str) -> None:
        """Types it once a second until it is answered so; the estimator takes time to settle."""
        end_s = time.monotonic() + DEADLINE_S
        while not self.has_said(words):
            assert time.monotonic() < end_s, f"MAVProxy's {words!r} not within {DEADLINE_S} s"
            self.types(line)
            PAUSE.wait(1.0)

    def quits(self) -> None:
        """At the end of its input."""
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


def test_it_connects_reads_parameters_changes_mode_and_arms(
    mavproxy: MavProxy, firmware: str, tmp_path: Path
) -> None:
    mavproxy.says("Detected vehicle 1:1")
    mavproxy.says(f"Received {len(load_table(firmware))} parameters\n")
    mavproxy.types(f"param save {tmp_path / 'all.parm'}")
    until((tmp_path / "all.parm").exists, "the parameters' file", DEADLINE_S)
    command, answer = CHANGE_MODE[firmware]
    mavproxy.types(command)
    mavproxy.says(answer)
    if firmware == "ardupilot":
        mavproxy.insists(ORIGIN, "EKF3 IMU0 origin set")
        assert not mavproxy.has_said("fence breach")
    mavproxy.insists("arm throttle", "\nARMED")
    mavproxy.types("disarm")
    mavproxy.says("\nDISARMED")
    mavproxy.quits()
    names = {line.split()[0] for line in (tmp_path / "all.parm").read_text().splitlines()}
    assert names - {"_HASH_CHECK"} == set(load_table(firmware))
