"""Records the true flight for scoring."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from companion.core.frames import Vector3
from companion.core.textfile import read_text
from companion.export.map_files import save_as
from sitl.core.truth import TrueState

PERIOD_S = 0.1
"""Period of the recorded path, s."""
AIRBORNE_M = 0.05
"""Height above which the vehicle counts as in the air, m."""


class TruthRecord:
    """The true path at 10 Hz, smallest clearance, collisions and time in the air."""

    def __init__(self, take_off: TrueState) -> None:
        self.path: list[TrueState] = [take_off]
        self.clearance_m = math.inf
        self.hits_ned_m: list[Vector3] = []
        """Place of each collision, in the world's frame."""
        self.air_time_s = 0.0
        self.apart_m: float | None = None
        """Smallest distance to the centre of another vehicle while both are in the air, m."""
        self._touching = False
        self._last_s = take_off.time_s

    @property
    def take_off(self) -> TrueState:
        return self.path[0]

    @property
    def collisions(self) -> int:
        return len(self.hits_ned_m)

    @property
    def notable_m(self) -> float:
        """A clearance up to this may be a new minimum or a collision, m."""
        return max(self.clearance_m, 0.0)

    def observe(self, state: TrueState, clearance_m: float) -> bool:
        """Record one step; True at the start of a collision.

        `clearance_m` is exact up to `notable_m`.
        """
        if state.time_s - self.path[-1].time_s >= PERIOD_S - 1e-9:
            self.path.append(state)
        if -state.position_ned_m[2] > AIRBORNE_M:
            self.air_time_s += state.time_s - self._last_s
        self._last_s = state.time_s
        self.clearance_m = min(self.clearance_m, clearance_m)
        hit = clearance_m <= 0 and not self._touching
        self._touching = clearance_m <= 0
        if hit:
            self.hits_ned_m.append(state.position_ned_m)
        return hit

    def observe_other(self, apart_m: float) -> None:
        """Record the distance to another vehicle while both are in the air, m."""
        self.apart_m = apart_m if self.apart_m is None else min(self.apart_m, apart_m)

    def save(self, path: Path) -> None:
        """Write as JSON.

        Raises:
            OutputError: the file cannot be written.
        """
        save_as(TruthRecord._write, self, path)

    def _write(self, path: Path) -> None:
        path.write_text(
            json.dumps(
                {
                    "path": [asdict(state) for state in self.path],
                    "clearance_m": self.clearance_m,
                    "collisions": self.collisions,
                    "hits_ned_m": self.hits_ned_m,
                    "air_time_s": self.air_time_s,
                    "apart_m": self.apart_m,
                }
            ),
            encoding="utf-8",
        )

    @classmethod
    def load(cls, path: Path) -> "TruthRecord":
        record = json.loads(read_text(path))
        states = [_state(state) for state in record["path"]]
        truth = cls(states[0])
        truth.path = states
        truth.clearance_m = record["clearance_m"]
        truth.hits_ned_m = [(north, east, down) for north, east, down in record["hits_ned_m"]]
        truth.air_time_s = record["air_time_s"]
        truth.apart_m = record["apart_m"]
        return truth


def truth_files(path: Path, vehicles: int) -> list[Path]:
    """One file for each vehicle; those after the first are numbered."""
    return [path, *(path.with_stem(f"{path.stem}_{n + 2}") for n in range(vehicles - 1))]


def _state(record: dict[str, Any]) -> TrueState:
    lists = {key: tuple(value) for key, value in record.items() if isinstance(value, list)}
    return TrueState(**(record | lists))
