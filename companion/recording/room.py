"""Checks before take-off that the flight's files can be written.

In flight a disk failure only ends the recording, because the drone has to return. On the ground the
card can still be replaced.
"""

import os
import shutil
from pathlib import Path

from companion.config.settings import Config
from companion.core.background_writer import BackgroundWriter
from companion.core.errors import OutputError
from companion.recording.disk import MIN_FREE_BYTES

BYTES_PER_MIN = 2_000_000
"""Upper limit of recording and tlog; see docs/recording.md."""
ANSWER_S = 10.0
"""Longest wait for the disk, s. Chosen."""


def needed_bytes(config: Config) -> int:
    """Upper limit of the flight's files, bytes."""
    minutes = config.mission.time_limit_s / 60 if config.recording.enabled else 0
    return MIN_FREE_BYTES + int(minutes * BYTES_PER_MIN)


def refuse_no_room(folder: Path, config: Config) -> int:
    """Check that files can be written to a folder, and that it has room for the flight's files.

    Returns the free space, bytes.

    Raises:
        OutputError: names the folder and the reason.
    """
    attempt = BackgroundWriter[Path](_try_write)
    attempt.write(folder)
    if not attempt.wait(ANSWER_S):
        raise OutputError(f"{folder}: the disk does not answer; use another disk or another --out")
    if attempt.trouble:
        raise OutputError(
            f"{folder}: {attempt.trouble}; the flight could not be saved there; "
            "fix this or use another --out"
        )
    needed, free = needed_bytes(config), shutil.disk_usage(folder).free
    if free < needed:
        raise OutputError(
            f"{folder}: {free / 1e6:.0f} MB are free, but recording and map may need up to "
            f"{needed / 1e6:.0f} MB; free some space or use another --out"
        )
    return free


def _try_write(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    trial = folder / f".trial-{os.getpid()}"
    try:
        with trial.open("wb") as file:
            file.write(bytes(4096))
            file.flush()
            os.fsync(file.fileno())
    finally:
        trial.unlink(missing_ok=True)
