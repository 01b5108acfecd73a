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

import math
from collections.abc import Iterator

from companion.offline.mapper import LogMap, map_part
from companion.offline.reading.log import Log, Watch, ignore
from companion.offline.reading.sensors import SensorsConfig

MIN_STRETCH_S = 30.0
"""Least length of a stretch, s. Chosen: in it a robot of 0.5 m/s goes round a room."""


def held_stretches(log: Log, sensors: SensorsConfig, watch: Watch) -> list[LogMap]:
    """Maps of the stretches whose own verdict is `trusted`, in the order of time.

    For a log whose map is doubtful. Neighbours are not joined.
    """
    length_s = float(log.time_s[-1] - log.time_s[0])
    found = []
    for part, result in _searched(log, sensors):
        if result is not None and result.verdict.trusted:
            found.append(result)
        watch("mapping stretches", float(part.time_s[-1] - log.time_s[0]) / max(length_s, 1e-9))
    return found


def _searched(log: Log, sensors: SensorsConfig) -> Iterator[tuple[Log, LogMap | None]]:
    """The halves of a log; those that are doubtful are halved again. None: too short."""
    middle = len(log.time_s) // 2
    for half in (log.part(slice(middle)), log.part(slice(middle, None))):
        if _length_s(half) < MIN_STRETCH_S:
            yield half, None
            continue
        result = map_part(half, sensors, ignore)
        if result.verdict.trusted:
            yield half, result
        else:
            yield from _searched(half, sensors)


def _length_s(log: Log) -> float:
    return float(log.time_s[-1] - log.time_s[0]) if len(log.time_s) > 1 else -math.inf
