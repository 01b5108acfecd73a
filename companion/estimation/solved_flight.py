"""The estimator's result for the map: walls, hits and path."""

from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import Vector3, wrap_rad
from companion.core.messages import Hit, Pose, WallLine
from companion.estimation.smoothing.flight_record import FlightRecord, FrameColumn, HitColumn
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits
from companion.estimation.smoothing.state import Measured, Unknowns, project


@dataclass(frozen=True, slots=True)
class SolvedFlight:
    """A flight in local NED: k poses and n hits."""

    walls: tuple[WallLine, ...]
    points_ne_m: Array
    """(n, 2): end of each beam."""
    wall_of: Indices
    """(n,): wall of each hit, or NO_WALL."""
    sigma_m: Array
    """(n,): sigma of each range."""
    poses: Array
    """(k, 3): north, east, yaw."""
    record: FlightRecord

    @classmethod
    def of(
        cls,
        record: FlightRecord,
        x: Unknowns,
        walls: tuple[WallLine, ...],
        wall_of: Indices,
        units: RangeUnits,
    ) -> "SolvedFlight":
        """Place the record by the solved unknowns."""
        m = Measured.of(record, units)
        points, sigma_m = project(x, m).points, units.sigma_m(m.beam, m.distance_m)
        return cls(walls, points, wall_of, sigma_m, x.poses[:, :3], record)

    def hits(self) -> tuple[Hit, ...]:
        """Hits as values."""
        columns = [HitColumn.TIME_S, HitColumn.BEAM, HitColumn.DOWN_M]
        points = self.points_ne_m.tolist()
        walls = [wall if wall >= 0 else None for wall in self.wall_of.tolist()]
        variances = (self.sigma_m**2).tolist()
        return tuple(
            Hit(time_s, BEAMS[int(beam)], (north_m, east_m, down_m), variance_m2, wall)
            for (time_s, beam, down_m), (north_m, east_m), variance_m2, wall in zip(
                self.record.hits[:, columns].tolist(), points, variances, walls, strict=True
            )
        )

    def thinned(self, most: int) -> tuple[tuple[Vector3, ...], tuple[Vector3, ...]]:
        """At most `most` hit points and `most` path points, NED."""
        ended_down_m = self.record.hits[:, [HitColumn.DOWN_M]]
        flown_down_m = self.record.frames[:, [FrameColumn.DOWN_M]]
        return (
            _every_nth(np.hstack([self.points_ne_m, ended_down_m]), most),
            _every_nth(np.hstack([self.poses[:, :2], flown_down_m]), most),
        )

    def path(self) -> tuple[Pose, ...]:
        """Keyframe poses as values."""
        columns = [
            FrameColumn.TIME_S,
            FrameColumn.DOWN_M,
            FrameColumn.POSITION_SIGMA_M,
            FrameColumn.YAW_SIGMA_RAD,
        ]
        return tuple(
            Pose(time_s, north_m, east_m, down_m, wrap_rad(yaw_rad), sigma_m, yaw_sigma_rad)
            for (time_s, down_m, sigma_m, yaw_sigma_rad), (north_m, east_m, yaw_rad) in zip(
                self.record.frames[:, columns].tolist(), self.poses.tolist(), strict=True
            )
        )


def _every_nth(points: Array, most: int) -> tuple[Vector3, ...]:
    stride = max(1, -(-len(points) // most))
    return tuple((north, east, down) for north, east, down in points[::stride].tolist())
