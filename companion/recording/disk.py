"""Writes a growing file in flight without blocking the control loop.

The control loop queues bytes. One thread writes them, so they survive the end of the process.
Another thread syncs them to the medium once a second, which may take longer on an SD card, so they
also survive a power loss.
"""

import os
import threading
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue

from companion.core.errors import RecordingError

SYNC_PERIOD_S = 1.0
"""Interval of the syncs, s. Chosen."""
MIN_FREE_BYTES = 16_000_000
"""Free space reserved for the map. Chosen."""
MAX_PENDING_BYTES = 16_000_000
"""Largest queue: five minutes of flight. Chosen: a disk with a larger backlog will not catch up."""
CLOSE_TIMEOUT_S = 5.0
"""Longest wait for each thread at the end, s. Chosen."""


class Disk:
    """One file, written from start to end.

    Raises:
        RecordingError: `append` and `close` raise it after the disk has failed, is full or hangs.
    The
            constructor raises it if the file exists or cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._error = ""
        self._pending_bytes = 0
        self._lock = threading.Lock()
        self._queue: SimpleQueue[tuple[bytes, bytes] | None] = SimpleQueue()
        self._closing = threading.Event()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror}") from error
        # daemons: a hanging disk must not block the program's exit
        self._writer = threading.Thread(target=self._guarded, args=(self._write,), daemon=True)
        self._syncer = threading.Thread(target=self._guarded, args=(self._sync,), daemon=True)
        self._writer.start()
        self._syncer.start()

    def append(self, data: bytes, tail: bytes = b"") -> None:
        """Queue the file's next bytes; `tail` follows them until more are appended."""
        with self._lock:
            self._pending_bytes += len(data)
            if self._pending_bytes > MAX_PENDING_BYTES:
                self._error = self._error or "the disk does not keep up"
        self._raise_error()
        self._queue.put((data, tail))

    def close(self) -> None:
        """Wait until all data is on the medium, with a timeout."""
        self._queue.put(None)
        self._writer.join(CLOSE_TIMEOUT_S)
        self._closing.set()
        self._syncer.join(CLOSE_TIMEOUT_S)
        if self._writer.is_alive() or self._syncer.is_alive():
            self._error = self._error or "the disk hangs"
        else:
            os.close(self._file)
        self._raise_error()

    def _raise_error(self) -> None:
        if self._error:
            raise RecordingError(f"{self.path}: {self._error}")

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except OSError as error:
            self._error = error.strerror or str(error)

    def _write(self) -> None:
        end = 0
        while (item := self._queue.get()) is not None:
            data, tail = item
            self._write_at(end, data + tail)
            end += len(data)
            with self._lock:
                self._pending_bytes -= len(data)

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
                self._error = f"less than {MIN_FREE_BYTES / 1e6:.0f} MB left, reserved for the map"
