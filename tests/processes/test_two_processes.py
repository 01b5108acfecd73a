"""Tests of both programs in separate processes, connected only by sockets."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import UdpTransport
from companion.recording import topics
from companion.run.unattended import EXIT_ENDED
from tests.foxglove_client import foxglove_client
from tests.processes.started import companion, flying, read_until, running_sitl, sitl
from tests.waiting import DEADLINE_S
from tests.worlds import SMALL_ROOM


def ask(mavlink_port: str, message: Any, system_id: int) -> float:
    """The value in the PARAM_VALUE from the vehicle of that system id."""
    station = UdpTransport(f"udpout:127.0.0.1:{mavlink_port}", 255, 190)
    deadline_s = time.monotonic() + DEADLINE_S
    try:
        while time.monotonic() < deadline_s:
            station.send(message)
            station.await_datagrams(station.datagrams_received + 1, 0.5)
            for answer in station.receive():
                if answer.get_type() == "PARAM_VALUE" and answer.get_srcSystem() == system_id:
                    return float(answer.param_value)
    finally:
        station.close()
    raise AssertionError("no PARAM_VALUE")


def test_a_flight_in_two_processes_equals_the_flight_in_one(tmp_path: Path) -> None:
    reports = {}
    for transport in ("direct", "udp"):
        out = tmp_path / transport
        live = ("--foxglove", "127.0.0.1:0")
        flown = subprocess.run(
            sitl("fly", SMALL_ROOM, "--seed=2", "--transport", transport, f"--out={out}", *live),
            check=True,
            timeout=DEADLINE_S,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert flown.stdout.count("ws://127.0.0.1:") == 1
        assert {"map.png", "map.ply", "map.json", "report.json"} <= set(os.listdir(out))
        reports[transport] = json.loads((out / "report.json").read_text())
        for wall_clock in ("waited_s", "speed_factor"):
            del reports[transport][wall_clock]
    assert reports["direct"] == reports["udp"]
    assert reports["udp"]["completed"] is True
    maps = [(tmp_path / transport / "map.json").read_bytes() for transport in reports]
    assert maps[0] == maps[1]


def test_the_companion_reports_a_killed_sitl_and_keeps_the_map(tmp_path: Path) -> None:
    with running_sitl("--speed", "1000") as (process, mavlink_port, bus_port):
        pilot = flying(mavlink_port, bus_port, tmp_path)
        read_until(pilot, "scanning parallel to the wall")
        process.kill()
        output, _ = pilot.communicate(timeout=DEADLINE_S)
    assert pilot.returncode == 1
    assert "clock is gone" in output
    assert "no message for 10 s" in re.sub(r"[\s│]+", " ", output)
    assert json.loads((tmp_path / "map.json").read_text())["walls"]
    assert (tmp_path / "map.png").exists()


def test_a_killed_vehicle_keeps_its_parameters(tmp_path: Path) -> None:
    kept = ("--params", str(tmp_path / "vehicle.parm"), "--param", "SYSID_THISMAV=3")
    with running_sitl(*kept) as (process, mavlink_port, _):
        message = mavlink.MAVLink_param_set_message(3, 1, b"GUID_TIMEOUT", 0.7, 9)
        assert ask(mavlink_port, message, 3) == pytest.approx(0.7)
        process.kill()
    assert (tmp_path / "vehicle.parm").read_text() == "GUID_TIMEOUT 0.7\n"
    with running_sitl(*kept) as (_, mavlink_port, _):
        message = mavlink.MAVLink_param_request_read_message(3, 1, b"GUID_TIMEOUT", -1)
        assert ask(mavlink_port, message, 3) == pytest.approx(0.7)


def test_the_companion_lands_on_sigterm_and_a_foxglove_client_sees_it(tmp_path: Path) -> None:
    with running_sitl("--speed", "1000") as (_, mavlink_port, bus_port):
        pilot = flying(mavlink_port, bus_port, tmp_path, "--foxglove", "127.0.0.1:0")
        said = read_until(pilot, "turning 360°")
        url = re.findall(r"ws://127\.0\.0\.1:\d+", said)[0]
        with foxglove_client(url, len(list(topics.described()))) as client:
            client.subscribe(topics.WALLS, topics.POSE)
            read_until(pilot, "scanning parallel to the wall")
            pilot.send_signal(signal.SIGTERM)
            output, _ = pilot.communicate(timeout=DEADLINE_S)
            messages = list(client.messages())
    assert pilot.returncode == EXIT_ENDED
    assert "landing was requested" in output
    assert (tmp_path / "map.json").exists()
    walls = [SceneUpdate.FromString(m.data) for m in messages if m.topic == topics.WALLS]
    poses = [Odometry.FromString(m.data) for m in messages if m.topic == topics.POSE]
    finally_mapped = json.loads((tmp_path / "map.json").read_text())["walls"]
    assert len(walls[-1].entities[0].cubes) == len(finally_mapped) > 0
    assert max(pose.pose.position.z for pose in poses) > 1


def test_a_missing_sitl_is_reported_with_the_command_to_start_within_10_s(tmp_path: Path) -> None:
    began_s = time.monotonic()
    result = subprocess.run(
        companion("fly", "--bus", "sitl://127.0.0.1:1", "--link", "udpout:127.0.0.1:1"),
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
        cwd=tmp_path,
    )
    assert result.returncode == 2
    assert time.monotonic() - began_s < 10
    assert "sitl://127.0.0.1:1" in result.stderr
    assert "sitl run room_100" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_missing_autopilot_is_reported_with_its_address(tmp_path: Path) -> None:
    with running_sitl("--speed", "1000") as (_, _, bus_port):
        silent = flying("1", bus_port, tmp_path)
        output, _ = silent.communicate(timeout=DEADLINE_S)
    assert silent.returncode == 1
    assert "no HEARTBEAT from an autopilot" in output
    assert "udpout:127.0.0.1:1" in output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fly", "kitchen"), ("kitchen", "room_100")),
        (("fly", "room_100", "--profile", "lidar"), ("lidar", "gp2y0a710k0f")),
        (("fly", "room_100", "--mission", "dance"), ("dance", "room")),
        (("fly", "room_100", "--set", "speed_m_s=9"), ("mission.speed_m_s", "9", "2")),
        (("fly", "room_100", "--beam", "none.toml"), ("none.toml",)),
        (("run", "room_100", "--mavlink", "serial"), ("serial",)),
        (("run", "room_100", "--param", "GUID_TIMEOU=1"), ("GUID_TIMEOU", "GUID_TIMEOUT")),
        (
            ("run", "room_100", "--vehicles", "2"),
            ("room_100", "1 start", "2 vehicles", "[[starts]]"),
        ),
        (("run", "room_100", "--autopilot", "external", "--lockstep"), ("--lockstep", "external")),
    ],
)
def test_invalid_arguments_give_a_one_line_error(
    arguments: tuple[str, ...], words: list[str]
) -> None:
    result = subprocess.run(
        sitl(*arguments), capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert all(word in result.stderr for word in words)


def test_a_port_in_use_is_reported() -> None:
    with running_sitl() as (_, _, bus_port):
        second = subprocess.run(
            sitl("run", "room_100", "--mavlink", "udpin:127.0.0.1:0", "--bus-port", bus_port),
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )
    assert second.returncode == 2
    assert bus_port in second.stderr


def test_the_companion_imports_nothing_of_sitl(tmp_path: Path) -> None:
    """Imports every module that the companion's process may use, then checks for sitl."""
    code = (
        "import pkgutil, sys, companion\n"
        "for m in pkgutil.walk_packages(companion.__path__, 'companion.'):\n"
        "    __import__(m.name) if not m.name.endswith('__main__') else None\n"
        "found = [n for n in sys.modules if n == 'sitl' or n.startswith('sitl.')]\n"
        "sys.exit(str(found) if found else 0)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        timeout=DEADLINE_S,
    )
    assert result.returncode == 0, result.stderr
