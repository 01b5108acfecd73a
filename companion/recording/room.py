"""Whether what a flight leaves can be kept, asked before the motors run.

In flight a disk that fails is told of and flown on with: the drone has to come home. On the ground
there is time to put in another card.
"""

import os
import shutil
from pathlib import Path

from companion.config.settings import Config
from companion.core.aside import Aside
from companion.core.errors import OutputError
from companion.recording.disk import MIN_FREE_BYTES

BYTES_PER_MIN = 2_000_000
"""More than recording and tlog take; see docs/recording.md."""
ANSWER_S = 10.0


def refuse_no_room(folder: Path, config: Config) -> None:
    """See that files can be written there, and that there is room for the flight's.

    Raises:
        OutputError: they cannot, or there is not; it names the folder.
    """
    attempt = Aside[Path](_write_something)
    attempt.give(folder)
    if not attempt.wait(ANSWER_S):
        raise OutputError(f"{folder}: the disk does not answer; take another one, or another --out")
    if attempt.trouble:
        raise OutputError(
            f"{folder}: {attempt.trouble}; nothing of the flight could be kept there: "
            "mend it, or take another --out"
        )
    needed = MIN_FREE_BYTES
    if config.recording.enabled:
        needed += int(config.mission.time_limit_s / 60 * BYTES_PER_MIN)
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise OutputError(
            f"{folder}: {free / 1e6:.0f} MB are free, and recording and map of a flight may take "
            f"{needed / 1e6:.0f} MB: make room, or take another --out"
        )


def _write_something(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    trial = folder / f".trial-{os.getpid()}"
    try:
        with trial.open("wb") as file:
            file.write(bytes(4096))
            file.flush()
            os.fsync(file.fileno())
    finally:
        trial.unlink(missing_ok=True)
