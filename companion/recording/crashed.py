"""The recording of a flight that a crash has cut short, looked at in some milliseconds.

It loads little: what takes longer to load must wait until the autopilot has heard of us.
"""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, McapRecord, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from companion.recording.shortest_end import SHORTEST_END

ESTIMATE = "/estimate"
FRESH_S = 30.0
"""Who comes back later does not know where the drone has gone meanwhile."""


@dataclass(frozen=True, slots=True)
class Crashed:
    """A flight without an end."""

    path: Path
    age_s: float
    """Since the last of it was written; negative if the clock on the wall was set back."""

    @property
    def is_fresh(self) -> bool:
        return 0 <= self.age_s <= FRESH_S

    def words(self) -> str:
        """Where it was, for people; it may not be known."""
        pose = _last_pose(self.path)
        if pose is None:
            return "back after a crash"
        north_m, east_m, up_m = pose["north_m"], pose["east_m"], -pose["down_m"]
        return f"back after a crash at north {north_m:.1f} east {east_m:.1f} up {up_m:.1f} m"


def find_crashed(folder: Path) -> Crashed | None:
    """The newest recording there, if it was not closed in order; none if the disk refuses it."""
    try:
        recordings = [(path.stat().st_mtime, path) for path in folder.glob("flight_*.mcap")]
        if not recordings:
            return None
        written_s, path = max(recordings)
        was_closed = not path.read_bytes().endswith(SHORTEST_END)
    except OSError:
        return None
    return None if was_closed else Crashed(path, time.time() - written_s)


def _last_pose(path: Path) -> dict[str, float] | None:
    try:
        with path.open("rb") as file:
            records: Iterator[McapRecord] = StreamReader(file, emit_chunks=True).records
            chunks = [record for record in records if isinstance(record, Chunk)]
        if not chunks:
            return None
        ids = {
            r.id for r in breakup_chunk(chunks[0]) if isinstance(r, Channel) and r.topic == ESTIMATE
        }
        for chunk in reversed(chunks):
            told = [
                record
                for record in breakup_chunk(chunk)
                if isinstance(record, Message) and record.channel_id in ids
            ]
            if told:
                pose: dict[str, float] = json.loads(told[-1].data)
                return pose
    except (OSError, ValueError, McapError):
        return None
    return None
