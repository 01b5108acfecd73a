"""Random and mutated input at the simulator: `python -m benchmarks.fuzz_sitl [--count N]`.

Counts what was survived, and how much memory grew over the second half of it.
"""

import argparse
import math
import resource
from random import Random

from companion.config import SensorsConfig
from companion.link.transport import make_codec
from sitl.autopilot.core import Autopilot
from sitl.sensors.board import SensorBoard
from sitl.sensors.server import BusConnection
from sitl.testing.fuzz import bus_request, mavlink_frame
from sitl.truth import TrueState

START = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)


def fuzz_autopilot(personality: str, count: int, seed: int) -> None:
    """Frames into the autopilot, a step of flight after every few; its answers must pack."""
    random = Random(seed)
    codec, answers = make_codec(255, 190), make_codec(1, 1)
    autopilot = Autopilot(seed, START, personality=personality)
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


def fuzz_bus(count: int, seed: int) -> None:
    """Requests into the served bus; nonsense is hung up on, the next client is served."""
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


def memory_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000)
    count = parser.parse_args().count
    for name, run in (
        ("frames at ardupilot", lambda n, s: fuzz_autopilot("ardupilot", n, s)),
        ("frames at px4", lambda n, s: fuzz_autopilot("px4", n, s)),
        ("bus requests", fuzz_bus),
    ):
        run(count // 2, 1)
        before_mb = memory_mb()
        run(count - count // 2, 2)
        print(f"{count} {name}: survived, {memory_mb() - before_mb:.1f} MB more in the second half")


if __name__ == "__main__":
    main()
