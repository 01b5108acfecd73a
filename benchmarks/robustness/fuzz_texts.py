"""Mutates files: samples of each kind, and changes such as truncated or inserted text."""

import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random

from companion.app import App
from companion.config.settings import Config, to_toml
from companion.core.messages import FloorPlan, GyroSample, RangeScan, VehicleState
from companion.link.link import Telemetry
from companion.recording.recorder import open_recorder
from companion.ticks import Inputs
from sitl.testing.actions.table import ACTIONS

ROOMS = Path(__file__).parents[2] / "sitl" / "world" / "rooms"
WORDS = (
    *(b"nan", b"inf", b"-inf", b"1e999", b"-1", b"0", b"9" * 400, b"true", b'""', b"''", b"[]"),
    *(b"{}", b"[[", b"]]", b"=", b"\n", b"\x00", b"\xff\xfe", b'"""', b"'''", b"1979-05-27"),
    *(b"[" * 300, b"kind", b"ranges", b"sensors", b"front", b"points", b"doors", b"for_s"),
    *(b"0x1F", b"\\uD800", b"\\u0000", b"..", b"/dev/null", b"udpin:::", b"serial:/dev/x:1"),
)
MISSION = b"""[mission]
kind = "room"
speed_m_s = 0.6

[[events]]
when = "scanning"
do = "link_down"
for_s = 0.4
"""
LOG = b"time_s,odom_x_m,odom_y_m,odom_yaw_rad,gyro_yaw_rad_s,front_m,left_m,right_m\n" + b"".join(
    b"%.2f,%.2f,0.0,0.01,0.0,%.2f,1.5,inf\n" % (0.1 * i, 0.05 * i, 4 - 0.05 * i) for i in range(20)
)


def mutated(name: str, random: Random) -> bytes:
    """A file of this kind after some changes; sometimes random bytes."""
    if random.random() < 0.02:
        return random.randbytes(random.randrange(200))
    data = random.choice(_samples(name))
    for _ in range(random.randrange(1, 5)):
        data = random.choice(CHANGES)(data, random)
    return data


@cache
def _samples(name: str) -> list[bytes]:
    if name == "drone.toml":
        return [b"", to_toml(Config()).encode(), DRONE]
    if name == "mission.toml":
        each = [f'[[events]]\nat_s = 1\ndo = "{do}"\nwith = 1\n'.encode() for do in ACTIONS]
        return [MISSION, *each]
    if name == "world.toml":
        return [path.read_bytes() for path in sorted(ROOMS.glob("*.toml"))]
    return [LOG] if name == "flight.csv" else [_recording()]


DRONE = b"""[link]
url = "serial:/dev/ttyAMA0:921600"
[sensors]
bus = "/dev/i2c-1"
[sensors.ranges.front]
kind = "sharp_ads1115"
address = 0x48
channel = 0
[sensors.calibration.front]
gain = 1.01
offset_m = 0.01
[mission]
standoff = "range"
after_crash = "resume"
"""


def _recording() -> bytes:
    """A recording of one second without a flight."""
    with tempfile.TemporaryDirectory() as folder:
        recorder = open_recorder(Path(folder), Config(), 0.0, print, continues="")
        app = App(Config())
        for tick in range(20):
            now_s = 0.05 * tick
            gyro = [GyroSample(now_s, 0.0)]
            inputs = Inputs(Telemetry(VehicleState()), gyro, RangeScan(now_s, {}))
            recorder.tick(now_s, inputs, app.step(now_s, inputs))
        recorder.close(FloorPlan())
        (path,) = Path(folder).glob("*.mcap")
        return path.read_bytes()


Change = Callable[[bytes, Random], bytes]


def _spot(data: bytes, random: Random) -> int:
    return random.randrange(len(data) + 1)


def _flip(data: bytes, random: Random) -> bytes:
    if not data:
        return data
    changed = bytearray(data)
    changed[random.randrange(len(data))] = random.randrange(256)
    return bytes(changed)


def _insert(data: bytes, random: Random) -> bytes:
    at = _spot(data, random)
    return data[:at] + random.choice(WORDS) + data[at:]


def _cut(data: bytes, random: Random) -> bytes:
    start = _spot(data, random)
    return data[:start] + data[start + random.randrange(1, 40) :]


def _tear(data: bytes, random: Random) -> bytes:
    return data[: _spot(data, random)]


def _double_a_line(data: bytes, random: Random) -> bytes:
    lines = data.split(b"\n")
    line = random.choice(lines)
    lines.insert(random.randrange(len(lines) + 1), line)
    return b"\n".join(lines)


def _replace_a_value(data: bytes, random: Random) -> bytes:
    lines = data.split(b"\n")
    number = random.randrange(len(lines))
    separator = b"," if b"=" not in lines[number] else b"="
    key, _, _ = lines[number].rpartition(separator)
    lines[number] = key + separator + random.choice(WORDS)
    return b"\n".join(lines)


CHANGES: tuple[Change, ...] = (_flip, _insert, _cut, _tear, _double_a_line, _replace_a_value)
