"""A recording flown once more, moment by moment, in a process of its own."""

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
SKETCH_PERIOD_S = 1.0
END_TIMEOUT_S = 5.0
_SPAWN = multiprocessing.get_context("spawn")


def replay_to(path: Path, page: Connection) -> None:
    """Send a snapshot ten times a second of the flight's time, and at last the map."""
    recording = read(path)
    app = App(recording.config)
    mount_offset_m = recording.config.sensors.mount_offset_m
    due_s = sketch_due_s = float("-inf")
    try:
        for tick in recording.ticks:
            outputs = app.step(tick.now_s, tick.inputs)
            if tick.now_s < due_s and not outputs.finished:
                continue
            due_s = tick.now_s + PERIOD_S - 1e-6
            with_sketch = tick.now_s >= sketch_due_s
            sketch_due_s = tick.now_s + SKETCH_PERIOD_S if with_sketch else sketch_due_s
            page.send(snapshot(app, tick.now_s, outputs, mount_offset_m, with_sketch=with_sketch))
        page.send(recording.plan or app.final_floor_plan())
    except (BrokenPipeError, KeyboardInterrupt):
        return


class Replayed:
    """`tell` hears snapshots and at last the map, in a thread of its own."""

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
