"""The Sharp sensor's alias: nearer than half a metre its reading grows again.

Which branch of its curve a voltage lies on, no single reading tells, but the way to it does: from
the last distance that could be believed, less how far the drone has moved along the beam since.

TRUSTED ──too near──► NEAR ──a distance, and dead reckoning says far──► TRUSTED
                       ▲ │
                       │ └──a distance, and dead reckoning says near──► too near, still NEAR
                       └──────────────────────────────────────────────────┘
NEAR ──turned by 20°: another thing is looked at──► TRUSTED
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from companion.drivers.readings import TOO_NEAR
from companion.frames import ned_to_frd, wrap_rad
from companion.messages import Beam, Odometry, RangeScan, RangeState

ALIAS_BELOW_M = 0.75
"""The true branch begins at 1 m, the alias at 0.42 m; dead reckoning tells them apart."""
BRANCH_BEGINS_M = 1.0
OTHER_THING_RAD = math.radians(20)
AXES_FRD = {
    Beam.FRONT: (1, 0, 0),
    Beam.RIGHT: (0, 1, 0),
    Beam.BACK: (-1, 0, 0),
    Beam.LEFT: (0, -1, 0),
    Beam.UP: (0, 0, -1),
    Beam.DOWN: (0, 0, 1),
}


@dataclass(slots=True)
class _Track:
    """One beam's: how far the thing is that was too near, and where it was looked at from."""

    distance_m: float
    yaw_rad: float


class FoldBack:
    """Says "too near" where a folding sensor says metres, for beams that have one."""

    def __init__(self, beams: Iterable[Beam]) -> None:
        self._beams = tuple(beams)
        self._near: dict[Beam, _Track] = {}
        self._odometry: Odometry | None = None

    def checked(self, scan: RangeScan, odometry: Odometry | None) -> RangeScan:
        """The scan without aliases; `odometry` is what has come since the last one, if any."""
        if odometry is not None:
            self._move(odometry)
        aliases = {beam: TOO_NEAR for beam in self._beams if self._is_alias(beam, scan)}
        return RangeScan(scan.time_s, {**scan.readings, **aliases}) if aliases else scan

    def _move(self, odometry: Odometry) -> None:
        last, self._odometry = self._odometry, odometry
        if last is None or not self._near:
            return
        north_m, east_m, down_m = (
            now - then
            for now, then in zip(odometry.position_ned_m, last.position_ned_m, strict=True)
        )
        moved_frd_m = (*ned_to_frd(north_m, east_m, odometry.yaw_rad), down_m)
        for beam, track in list(self._near.items()):
            track.distance_m -= sum(
                axis * moved_m for axis, moved_m in zip(AXES_FRD[beam], moved_frd_m, strict=True)
            )
            if abs(wrap_rad(odometry.yaw_rad - track.yaw_rad)) > OTHER_THING_RAD:
                del self._near[beam]

    def _is_alias(self, beam: Beam, scan: RangeScan) -> bool:
        reading = scan.readings.get(beam)
        if reading is None or self._odometry is None:
            return False
        if reading.state is RangeState.TOO_NEAR:
            self._near.setdefault(beam, _Track(BRANCH_BEGINS_M, self._odometry.yaw_rad))
            return False
        track = self._near.get(beam)
        if track is None or not (reading.is_distance or reading.state is RangeState.NOTHING):
            return False
        if track.distance_m < ALIAS_BELOW_M:
            return True
        del self._near[beam]
        return False
