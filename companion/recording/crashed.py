"""Finds the recording of a flight that was interrupted by a crash, within milliseconds.

The module has few imports: a slow import would delay the first messages to the autopilot.
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
"""Topic of the pose estimates."""
FRESH_S = 30.0
"""Maximum age of a recording for a recovery, s. Chosen: later the drone's motion since is
unknown."""


@dataclass(frozen=True, slots=True)
class Crashed:
    """A recording of a flight without an end."""

    path: Path
    age_s: float
    """Time since its last write; negative if the system clock was set back."""

    @property
    def is_fresh(self) -> bool:
        return 0 <= self.age_s <= FRESH_S

    def words(self) -> str:
        """Text of the last known position, if any."""
        pose = _last_pose(self.path)
        if pose is None:
            return "back after a crash"
        north_m, east_m, up_m = pose["north_m"], pose["east_m"], -pose["down_m"]
        return f"back after a crash at north {north_m:.1f} east {east_m:.1f} up {up_m:.1f} m"


def find_crashed(folder: Path) -> Crashed | None:
    """The newest recording in a folder if it was not closed; None also if the disk fails."""
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
            estimates = [
                record
                for record in breakup_chunk(chunk)
                if isinstance(record, Message) and record.channel_id in ids
            ]
            if estimates:
                pose: dict[str, float] = json.loads(estimates[-1].data)
                return pose
    except (OSError, ValueError, McapError):
        return None
    return None
