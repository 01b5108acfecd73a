"""A file that grows while the drone flies, and never makes it wait.

The control loop hands bytes over and goes on. One thread writes them, so that they outlive the
process at once; another brings them to the medium once a second, which on an SD card may take
longer than that, so that they outlive the power, too.
"""

import os
import threading
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue

from companion.core.errors import RecordingError

SYNC_PERIOD_S = 1.0
MIN_FREE_BYTES = 16_000_000
"""Less than this is left for the map, which is what the flight is for."""
MAX_WAITING_BYTES = 16_000_000
"""Five minutes of flight; a disk that is this far behind will not catch up."""
CLOSE_TIMEOUT_S = 5.0


class Disk:
    """One file, written from its start to its end.

    Raises:
        RecordingError: from `append` and `close`, once the disk has failed, is full or hangs. From
            the start: the file exists already or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._trouble = ""
        self._waiting_bytes = 0
        self._lock = threading.Lock()
        self._queue: SimpleQueue[tuple[bytes, bytes] | None] = SimpleQueue()
        self._closing = threading.Event()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror}") from error
        # daemons: a hanging disk must not keep the program from ending
        self._writer = threading.Thread(target=self._guarded, args=(self._write,), daemon=True)
        self._syncer = threading.Thread(target=self._guarded, args=(self._sync,), daemon=True)
        self._writer.start()
        self._syncer.start()

    def append(self, data: bytes, tail: bytes = b"") -> None:
        """Hand over the file's next bytes; `tail` stands behind them until more follow."""
        with self._lock:
            self._waiting_bytes += len(data)
            if self._waiting_bytes > MAX_WAITING_BYTES:
                self._trouble = self._trouble or "the disk does not keep up"
        self._refuse_trouble()
        self._queue.put((data, tail))

    def close(self) -> None:
        """Wait until everything is on the medium, but not for ever."""
        self._queue.put(None)
        self._writer.join(CLOSE_TIMEOUT_S)
        self._closing.set()
        self._syncer.join(CLOSE_TIMEOUT_S)
        if self._writer.is_alive() or self._syncer.is_alive():
            self._trouble = self._trouble or "the disk hangs"
        else:
            os.close(self._file)
        self._refuse_trouble()

    def _refuse_trouble(self) -> None:
        if self._trouble:
            raise RecordingError(f"{self.path}: {self._trouble}")

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except OSError as error:
            self._trouble = error.strerror or str(error)

    def _write(self) -> None:
        end = 0
        while (item := self._queue.get()) is not None:
            data, tail = item
            self._write_at(end, data + tail)
            end += len(data)
            with self._lock:
                self._waiting_bytes -= len(data)

    def _write_at(self, offset: int, data: bytes) -> None:
        while data:
            written = os.pwrite(self._file, data, offset)
            data, offset = data[written:], offset + written

    def _sync(self) -> None:
        is_last = False
        while not is_last:
            is_last = self._closing.wait(SYNC_PERIOD_S)
            os.fdatasync(self._file)
            space = os.fstatvfs(self._file)
            if space.f_bavail * space.f_frsize < MIN_FREE_BYTES:
                self._trouble = (
                    f"less than {MIN_FREE_BYTES / 1e6:.0f} MB left, which the map may need"
                )
