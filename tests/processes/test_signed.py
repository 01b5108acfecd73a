"""Tests signing with real processes: key files, UDP, and a sender without the key."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests.processes.started import companion, running_sitl, sitl
from tests.waiting import DEADLINE_S
from tests.worlds import SMALL_ROOM


@pytest.fixture
def key(tmp_path: Path) -> Path:
    path = tmp_path / "signing.key"
    path.write_text("5a" * 32)
    os.chmod(path, 0o600)
    return path


def test_a_flight_over_signed_udp_completes(tmp_path: Path, key: Path) -> None:
    config = tmp_path / "drone.toml"
    config.write_text(f'[link]\nsigning_key = "{key}"\n')
    out = tmp_path / "out"
    options = ("--config", str(config), "--transport", "udp", "--out", str(out))
    subprocess.run(
        sitl("fly", SMALL_ROOM, *options),
        check=True,
        timeout=DEADLINE_S,
        stdout=subprocess.DEVNULL,
    )
    assert json.loads((out / "report.json").read_text())["completed"] is True
    assert key.with_suffix(".timestamp").exists()


def test_a_companion_without_the_key_finds_no_autopilot(tmp_path: Path, key: Path) -> None:
    with running_sitl("--signing-key", str(key)) as (_, mavlink_port, bus_port):
        ended = subprocess.run(
            companion(
                *("check", "--link", f"udpout:127.0.0.1:{mavlink_port}"),
                *("--bus", f"sitl://127.0.0.1:{bus_port}", "--seconds", "3"),
            ),
            check=False,
            timeout=DEADLINE_S,
            capture_output=True,
            text=True,
        )
    # its messages are rejected, so the vehicle does not learn its address
    assert ended.returncode == 1
    assert "no autopilot of system 1" in ended.stdout
