"""Names the convention of axes that a log probably has, if it is not that of the companion.

Logs of other programs count yaw counter-clockwise, or have x to the east, or their left sensor is
the right one. In a symmetric room such a log gives a map that fits, but is mirrored. So the first
rows are mapped by each convention, at first with the path of the odometry, which needs no search.
The right convention predicts held-out ranges best.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from companion.core.messages import Beam
from companion.offline.reading.log import Log

TRIED_ROWS = 200
"""Rows that are tried. Chosen: later the odometry has drifted, and its map fits no convention."""
BETTER_BY_ODOMETRY, BETTER_BY_MAP = 0.05, 0.1
"""Least differences of the gains, nats per range: with the path of the odometry, and corrected.
Measured: by odometry none of four others is better than the right one, in 24 synthetic and 31
public logs; by map each other one is worse by 0.15 to 1.7, in rooms."""
EXCHANGED = {Beam.LEFT: Beam.RIGHT, Beam.RIGHT: Beam.LEFT}
TURNED = {Beam.FRONT: Beam.BACK, Beam.BACK: Beam.FRONT, **EXCHANGED}
"""For each beam, the one whose ranges it gets: with sides exchanged, and with the robot turned."""


def likelier_axes(
    log: Log, gain_by_odometry: Callable[[Log], float], gain_by_map: Callable[[Log], float]
) -> str | None:
    """What to change in a log so that its ranges fit better; None if it is right as it is.

    The functions return the mean gain (`held_out.py`) of a log.
    """
    first = log.part(slice(TRIED_ROWS))
    conventions = _conventions(first)
    gains = [gain_by_odometry(changed) for _, changed in conventions]
    best = int(np.argmax(gains))
    if gains[best] < gain_by_odometry(first) + BETTER_BY_ODOMETRY:
        return None
    remedy, changed = conventions[best]
    is_better = gain_by_map(changed) > gain_by_map(first) + BETTER_BY_MAP
    return remedy if is_better else None


def _conventions(log: Log) -> list[tuple[str, Log]]:
    turned_back = None if log.gyro_rad_s is None else -log.gyro_rad_s
    return [
        (
            "left_m and right_m exchanged, or odom_y_m, odom_yaw_rad and the gyro negated",
            _with_beams(log, EXCHANGED),
        ),
        (
            "odom_yaw_rad and the gyro negated",
            replace(log, odometry=log.odometry * (1, 1, -1), gyro_rad_s=turned_back),
        ),
        ("odom_x_m and odom_y_m exchanged", replace(log, odometry=log.odometry[:, [1, 0, 2]])),
        ("all sensors turned by 180°, as front_m and back_m", _with_beams(log, TURNED)),
    ]


def _with_beams(log: Log, source: dict[Beam, Beam]) -> Log:
    """The log with the ranges of some beams given to others."""
    nothing = np.full(len(log.time_s), np.nan)
    ranges_m = dict(log.ranges_m)
    for beam, other in source.items():
        if beam in log.ranges_m or other in log.ranges_m:
            ranges_m[beam] = log.ranges_m.get(other, nothing)
    return replace(log, ranges_m=ranges_m)
