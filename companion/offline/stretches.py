"""Finds the longest stretches of a log whose own maps hold, where that of the whole log does not.

A heading that jumps once, or a hall without walls near, spoils the map of the whole. The rooms
before and after it may still be mapped well. So a log whose map is doubtful is halved, and each
half that is still doubtful again:

    whole        ━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━  doubtful
    halves       ━━━━━━━━━━━━━━━━  trusted          ────────────────  doubtful
    quarters                                       ━━━━━━━━ trusted   ──────── doubtful, too short

Each stretch has a map of its own, in the frame of the log's odometry. Nothing says how two of them
lie to each other, but the odometry between them.
"""

from collections.abc import Callable, Iterator

import numpy as np

from companion.offline.mapper import LogMap, map_part
from companion.offline.reading.log import Log, Watch, ignore
from companion.offline.reading.sensors import SensorsConfig

MIN_STRETCH_S = 30.0
"""Least length of a stretch, s. Chosen: in it a robot of 0.5 m/s goes round a room."""


def held_stretches(log: Log, sensors: SensorsConfig, watch: Watch) -> list[LogMap]:
    """Maps of the stretches whose own verdict is `trusted`, in the order of time.

    For a log whose map is doubtful. Neighbours are not joined.
    """
    begin_s, length_s = log.time_s[0], _length_s(log)

    def searched_to(end_s: float) -> None:
        watch("mapping stretches", (end_s - begin_s) / length_s)

    return list(_held(log, sensors, searched_to))


def _held(
    log: Log, sensors: SensorsConfig, searched_to: Callable[[float], None]
) -> Iterator[LogMap]:
    """Maps of the halves that hold, and of parts of those that do not."""
    middle = len(log.time_s) // 2
    for half in (log.part(slice(middle)), log.part(slice(middle, None))):
        if _length_s(half) < MIN_STRETCH_S:
            continue
        result = map_part(half, sensors, ignore)
        if result.verdict.trusted:
            yield result
        else:
            yield from _held(half, sensors, searched_to)
        searched_to(float(half.time_s[-1]))


def _length_s(log: Log) -> float:
    return float(np.ptp(log.time_s)) if len(log.time_s) else 0.0
