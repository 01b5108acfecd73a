"""Replays a recording in a separate process and passes on its snapshots."""

import multiprocessing
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

from companion.app import App
from companion.core.messages import FloorPlan
from companion.recording.reader import read
from companion.view.snapshot import Snapshot, snapshot

PERIOD_S = 0.1
"""Flight time between snapshots, s. Chosen: as in `companion.view.feed`."""
SKETCH_PERIOD_S = 1.0
"""Flight time between snapshots that contain the map, s. Chosen: as in `companion.view.feed`."""
END_TIMEOUT_S = 5.0
"""Longest wait for process and thread to end, s. Chosen."""
_SPAWN = multiprocessing.get_context("spawn")


def replay_to(path: Path, page: Connection) -> None:
    """Replay a recording; send ten snapshots per second of flight time, then the final map."""
    recording = read(path)
    app = App(recording.config, recording.earlier)
    due_s = sketch_due_s = float("-inf")
    try:
        for tick in recording.ticks:
            outputs = app.step(tick.now_s, tick.inputs)
            if tick.now_s < due_s and not outputs.finished:
                continue
            due_s = tick.now_s + PERIOD_S - 1e-6
            with_sketch = tick.now_s >= sketch_due_s
            sketch_due_s = tick.now_s + SKETCH_PERIOD_S if with_sketch else sketch_due_s
            seen = tick.now_s, tick.inputs, outputs
            page.send(snapshot(app, *seen, recording.config, with_sketch=with_sketch))
        page.send(recording.plan or app.final_floor_plan())
    except (BrokenPipeError, KeyboardInterrupt):
        return


class Replayed:
    """Calls `tell` with each snapshot and then the final map, in a separate thread."""

    def __init__(self, path: Path, tell: Callable[[Snapshot | FloorPlan], None]) -> None:
        self._tell = tell
        self._ours, theirs = _SPAWN.Pipe(duplex=False)
        self._process = _SPAWN.Process(target=replay_to, args=(path, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        try:
            while True:
                self._tell(self._ours.recv())
        except (EOFError, OSError):
            return

    def close(self) -> None:
        self._process.terminate()
        self._process.join(END_TIMEOUT_S)
        self._listener.join(END_TIMEOUT_S)
        self._ours.close()
