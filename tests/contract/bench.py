"""A test bench for sensors of any kind: distances, yaw rate and time can be set."""

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from companion.config.settings import SensorsConfig
from companion.core.frames import Vector3
from companion.core.messages import Beam, RangeScan
from companion.drivers.ranges import RangeSensors
from companion.drivers.wires.bus import Transaction, Wires
from companion.link.transports.transport import decode, make_codec
from sitl.autopilot.estimation.own_sensors import rangefinder_messages
from sitl.core.truth import TrueState
from sitl.sensors.board import SensorBoard

STILL = TrueState(0.0, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
TICK_S = 0.05

BEAM_DIRECTIONS: dict[Beam, Vector3] = {
    Beam.FRONT: (1.0, 0.0, 0.0),
    Beam.RIGHT: (0.0, 1.0, 0.0),
    Beam.LEFT: (0.0, -1.0, 0.0),
    Beam.UP: (0.0, 0.0, -1.0),
    Beam.DOWN: (0.0, 0.0, 1.0),
}
FIVE = tuple(BEAM_DIRECTIONS)


def five(sensor: Mapping[str, Any], **by_number: str) -> dict[str, Any]:
    """Keys with the same sensor for each beam; `by_number` has patterns of the beam's number."""

    def entry(number: int) -> dict[str, Any]:
        own = {key: pattern.format(number) for key, pattern in by_number.items()}
        return {**sensor, **own}

    return {"ranges": {beam: entry(number) for number, beam in enumerate(FIVE)}}


KINDS: dict[str, dict[str, Any]] = {
    "gp2y0a710k0f": {"profile": "gp2y0a710k0f"},
    "paper": {"profile": "paper"},
    "mcp3008": five({"kind": "sharp_mcp3008"}, channel="{}"),
    "vl53l1x": {"profile": "vl53l1x"},
    "two multiplexers": {
        "ranges": {
            beam: {"kind": "vl53l1x", "mux_address": 0x70 + number % 2, "mux_channel": number // 2}
            for number, beam in enumerate(FIVE)
        }
    },
    "tfmini_s": {"profile": "tfmini_s"},
    "tf_luna": {"profile": "tf_luna"},
    "autopilot": five({"kind": "autopilot", "min_m": 0.2, "max_m": 5.0, "sigma_m": 0.03}),
    "mixed": {
        "ranges": {
            "front": {"kind": "vl53l1x"},
            "left": {"kind": "sharp_mcp3008", "channel": 3},
            "right": {"kind": "tfmini_s", "port": "/dev/ttyUSB0"},
            "up": {"kind": "sharp_ads1115", "address": 0x48, "channel": 0},
            "down": {"kind": "autopilot", "sigma_m": 0.03},
        }
    },
}


@dataclass
class Bench:
    """The sensors' chips, and the surfaces in front of them."""

    bus: Wires
    board: SensorBoard
    config: SensorsConfig
    distances_m: dict[Beam, float | None]
    truth: TrueState = STILL
    moving_away_m_s: float = 0.0
    """Speed of all surfaces since `time_s` was `from_s`."""
    from_s: float = 0.0
    time_s: float = 1.0
    codec: Any = field(default_factory=lambda: make_codec(1, 1))

    def passes(self, seconds: float) -> float:
        self.time_s += seconds
        self.board.bus.set_time(self.time_s)
        return self.time_s

    def distance_m(self, beam: Beam, time_s: float) -> float | None:
        distance_m = self.distances_m[beam]
        if distance_m is None:
            return None
        return distance_m + self.moving_away_m_s * (time_s - self.from_s)

    def sweep(self, sensors: RangeSensors) -> RangeScan:
        """One tick: the autopilot's own sensors, then all beams."""
        time_s = self.passes(TICK_S)
        if sensors.from_autopilot is not None and not self.board.bus.is_broken:
            reported = rangefinder_messages(self.board.from_autopilot, round(1000 * time_s))
            for message in decode(self.codec, b"".join(m.pack(self.codec) for m in reported)):
                sensors.from_autopilot.receive(message, time_s)
        return sensors.read(time_s)


class Noisy:
    """Wires on which every received byte is random."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        return [self._random.randbytes(t.count) for t in transactions]

    def exchange(self, device: str, data: bytes) -> bytes:
        return self._random.randbytes(len(data))

    def receive(self, port: str, baud: int) -> bytes:
        return self._random.randbytes(self._random.randrange(60))

    def close(self) -> None: ...


class Switched:
    """Wires that can be replaced while drivers use them."""

    def __init__(self, wires: Wires | Noisy) -> None:
        self.wires = wires

    def __getattr__(self, name: str) -> object:
        return getattr(self.wires, name)


def make_bench(kind: str) -> Bench:
    config = SensorsConfig.model_validate({**KINDS[kind], "mount_offset_m": 0.0})
    bench: Bench
    queried_s = 0.0

    def truth_at(time_s: float) -> TrueState:
        nonlocal queried_s
        queried_s = time_s
        return replace(bench.truth, time_s=time_s)

    def range_m(origin: Vector3, direction: Vector3, most_m: float) -> float | None:
        beam = min(FIVE, key=lambda b: math.dist(direction, BEAM_DIRECTIONS[b]))
        distance_m = bench.distance_m(beam, queried_s)
        return distance_m if distance_m is not None and distance_m <= most_m else None

    board = SensorBoard(1, config, lambda beam: range_m, truth_at)
    bench = Bench(board.bus, board, config, dict.fromkeys(FIVE, 2.0))
    board.bus.set_time(bench.time_s)
    return bench
