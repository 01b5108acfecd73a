"""Feeds random and mutated input to every interface.

Command: `python -m benchmarks.robustness.fuzz TARGET --inputs N`.

TARGET is one of those below, or all. Prints the number of inputs and the growth of memory over the
second half. Any error but the interface's own rejection ends it, with the seed to reproduce it. So
does an input that takes longer than five seconds.
"""

import argparse
import math
import signal
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from random import Random

from benchmarks.measured import peak_mb
from benchmarks.robustness import fuzz_texts
from companion.app import App
from companion.config import settings as configuration
from companion.config.settings import Config, LinkConfig, SensorsConfig
from companion.core.errors import CompanionError
from companion.core.messages import GyroSample, RangeScan
from companion.drivers.chips.ads1115 import config_word
from companion.drivers.chips.lsm9ds1 import WHO_AM_I, Lsm9ds1
from companion.drivers.chips.tfmini import Tfmini
from companion.drivers.chips.time_of_flight import TFMINI_S
from companion.drivers.ranges import RangeSensors
from companion.drivers.wires.bus import Transaction
from companion.link.link import Link
from companion.link.transports.transport import Message, decode, make_codec
from companion.offline.reading.readers import read_log
from companion.recording.reader import read
from companion.ticks import Inputs
from sitl.autopilot.core import Autopilot
from sitl.core.errors import SitlError
from sitl.core.truth import TrueState
from sitl.sensors.board import SensorBoard
from sitl.sensors.server import BusConnection
from sitl.testing.fuzz import bus_request, mavlink_frame, serial_bytes, vehicle_frame
from sitl.testing.mission_file import load_mission
from sitl.world.format import parse_world

START = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
LONGEST_S = 5
MAX_REST_BYTES = 64
TICK_S = 0.05
IN_MEMORY = Path("/dev/shm") if Path("/dev/shm").is_dir() else None
"""Folder in memory if there is one: writing to a disk takes longer than reading the file."""


# MAVLink


def fuzz_autopilot(firmware: str, count: int, seed: int) -> None:
    """Send frames to the emulated autopilot with a step after every few; encode its responses."""
    random = Random(seed)
    codec, answers = make_codec(255, 190), make_codec(1, 1)
    autopilot = Autopilot(seed, START, firmware=firmware)
    for number in range(count):
        frame = mavlink_frame(random)
        for message in codec.parse_buffer(frame) or []:
            if message.get_type() != "BAD_DATA":
                autopilot.receive(message)
        if number % 4 == 0:
            autopilot.step()
        for message in autopilot.take_outbox():
            message.pack(answers)
        assert all(map(math.isfinite, autopilot.truth.position_ned_m))


class FakeTransport:
    """A transport that returns given messages, and encodes those sent."""

    def __init__(self) -> None:
        self.incoming: list[Message] = []
        self._codec = make_codec(1, 191)

    def receive(self) -> list[Message]:
        incoming, self.incoming = self.incoming, []
        return incoming

    def send(self, message: Message) -> None:
        message.pack(self._codec)

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


def fuzz_companion(count: int, seed: int) -> None:
    """Send frames as the vehicle to the companion; its estimate stays finite and it keeps running.

    A new flight begins after ten thousand frames, or when one has ended.
    """
    random, codec = Random(seed), make_codec(1, 1)
    for number in range(count):
        if number % 10_000 == 0:
            transport = FakeTransport()
            link, app, now_s = Link(transport, LinkConfig()), App(Config()), 0.0
        transport.incoming += decode(codec, vehicle_frame(random))
        if number % 4:
            continue
        now_s += TICK_S
        gyro = [GyroSample(now_s - TICK_S + 0.01 * i, 0.001 * i) for i in range(5)]
        inputs = Inputs(link.poll(now_s), gyro, RangeScan(now_s, {}))
        outputs = app.step(now_s, inputs)
        link.send(now_s, outputs.setpoint, outputs.command, outputs.pose)
        if outputs.pose is not None:
            pose = outputs.pose
            assert all(map(math.isfinite, (pose.north_m, pose.east_m, pose.down_m, pose.yaw_rad)))
        if outputs.finished:
            app = App(Config())


# Sensors


def fuzz_bus(count: int, seed: int) -> None:
    """Send requests to the served bus; after a malformed one, a new client connects."""
    random = Random(seed)
    board = SensorBoard(
        seed, SensorsConfig(), lambda beam: lambda origin, direction, most_m: 2.0, lambda t: START
    )
    for _ in range(count):
        connection = BusConnection(board.bus, lambda: 0.0)
        for _ in range(random.randrange(1, 4)):
            if not connection.closing:
                connection.feed(bus_request(random))
            if connection.waits_for:
                connection.reach(connection.waits_for.target_s, 0)


class RandomWires:
    """Wires with random responses of the right length, or none."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self.is_sane = True
        """At the start the chips identify themselves correctly."""

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        if not self.is_sane and self._random.random() < 0.1:
            raise OSError("no acknowledge")
        return [self._answer(transaction) for transaction in transactions]

    def _answer(self, transaction: Transaction) -> bytes:
        if self.is_sane and transaction.count == 1:
            return bytes([WHO_AM_I])
        if self.is_sane:
            return config_word(0).to_bytes(2, "big")[: transaction.count]
        kind = self._random.random()
        if kind < 0.1:
            return bytes([self._random.choice((0, 0xFF))]) * transaction.count
        return self._random.randbytes(transaction.count)

    def exchange(self, device: str, data: bytes) -> bytes:
        if self.is_sane:
            return bytes(len(data))
        return self._random.randbytes(len(data))

    def receive(self, port: str, baud: int) -> bytes:
        return serial_bytes(self._random)

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


def fuzz_replies(count: int, seed: int) -> None:
    """Feed random responses to the drivers of ADS1115, MCP3008, TFmini-S and the gyro."""
    random = Random(seed)
    wires = RandomWires(random)
    gyro = Lsm9ds1(wires, 0x6B)
    all_ranges = [RangeSensors(wires, sensors) for sensors in MIXES]
    wires.is_sane = False
    for number in range(count):
        time_s = number * TICK_S
        for sample in gyro.read(time_s):
            assert math.isfinite(sample.yaw_rate_rad_s)
        for ranges in all_ranges:
            for reading in ranges.read(time_s).readings.values():
                assert not reading.is_distance or 0 < reading.distance_m < 100


SPI = {"kind": "sharp_mcp3008", "device": "/dev/spidev0.0"}
MIXES = (
    SensorsConfig(),
    SensorsConfig(profile="tfmini_s"),
    SensorsConfig.model_validate({"ranges": {"front": {**SPI, "channel": 0}}}),
)


def fuzz_serial(count: int, seed: int) -> None:
    """Feed random bytes to the TFmini-S driver; its buffer stays short."""
    random = Random(seed)
    sensor = Tfmini(RandomWires(random), "/dev/ttyAMA0", 115200, TFMINI_S)
    for number in range(count):
        reading = sensor.read(number * TICK_S)
        assert reading is None or not reading.is_distance or 0 < reading.distance_m < 100
        assert len(sensor._rest) < MAX_REST_BYTES


# Files


def fuzz_file(name: str, load: Callable[[Path], object], count: int, seed: int) -> None:
    """Feed mutated files to their reader, which may only accept or reject them in one line."""
    random = Random(seed)
    with tempfile.TemporaryDirectory(dir=IN_MEMORY) as folder:
        path = Path(folder) / name
        for _ in range(count):
            path.write_bytes(fuzz_texts.mutated(name, random))
            try:
                load(path)
            except (CompanionError, SitlError) as error:
                reason = str(error)
            else:
                continue
            assert "\n" not in reason, reason


TARGETS: dict[str, Callable[[int, int], None]] = {
    "ardupilot": lambda count, seed: fuzz_autopilot("ardupilot", count, seed),
    "px4": lambda count, seed: fuzz_autopilot("px4", count, seed),
    "companion": fuzz_companion,
    "bus": fuzz_bus,
    "replies": fuzz_replies,
    "serial": fuzz_serial,
    "config": lambda count, seed: fuzz_file("drone.toml", configuration.load, count, seed),
    "mission": lambda count, seed: fuzz_file(
        "mission.toml", lambda path: load_mission(str(path)), count, seed
    ),
    "world": lambda count, seed: fuzz_file(
        "world.toml",
        lambda path: parse_world(path.read_bytes().decode(errors="replace"), str(path)),
        count,
        seed,
    ),
    "log": lambda count, seed: fuzz_file(
        "flight.csv", lambda path: read_log(path, lambda *_: None), count, seed
    ),
    "recording": lambda count, seed: fuzz_file("flight.mcap", read, count, seed),
}


@contextmanager
def no_hang(seconds: int) -> Iterator[None]:
    """Raise `TimeoutError` if the block takes longer."""

    def give_up(number: int, frame: object) -> None:
        raise TimeoutError(f"nothing for {seconds} s")

    signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)


def fuzz(target: str, count: int, seed: int, batch: int = 1000) -> None:
    """Run in batches with a time limit."""
    for number, first in enumerate(range(0, count, batch)):
        with no_hang(LONGEST_S * 12):
            TARGETS[target](min(batch, count - first), seed * 1_000_003 + number)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("target", choices=(*TARGETS, "all"))
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for target in TARGETS if options.target == "all" else (options.target,):
        began_s = time.monotonic()
        fuzz(target, options.inputs // 2, 2 * options.seed)
        before_mb = peak_mb()
        fuzz(target, options.inputs - options.inputs // 2, 2 * options.seed + 1)
        print(
            f"{target:10} {options.inputs} inputs survived in {time.monotonic() - began_s:.0f} s, "
            f"{peak_mb() - before_mb:.1f} MB more in the second half",
            flush=True,
        )


if __name__ == "__main__":
    main()
