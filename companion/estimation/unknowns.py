"""What the smoother solves for, and the record of the flight as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.estimation.keyframes import Keyframe, KeyframeHit
from companion.messages import Beam, RangeModel, WallLine

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

POSE_SIZE = 4
BEAMS = tuple(Beam)
WALL_SIZE = 2


@dataclass(slots=True)
class Unknowns:
    """Everything that is not known exactly; angles in rad, local NED."""

    poses: Array
    """(k, 4): north, east, yaw (not wrapped), gyro bias."""
    walls: Array
    """(w, 2): direction of the normal, offset."""
    gyro_scale: float
    odometry_scale: float
    range_gain: Array
    """(beams,): how much too far each unit reads, relative."""

    @classmethod
    def guessed(
        cls, frames: Sequence[Keyframe], walls: Sequence[WallLine], bias_rad_s: float
    ) -> "Unknowns":
        """As the filters have it, scales and gains as if the sensors were perfect."""
        poses = [(f.guess.north_m, f.guess.east_m, f.guess.yaw_rad, bias_rad_s) for f in frames]
        lines = [(wall.normal_rad, wall.offset_m) for wall in walls]
        unknowns = cls(
            np.array(poses), np.array(lines).reshape(-1, WALL_SIZE), 0.0, 0.0, np.zeros(len(BEAMS))
        )
        unknowns.poses[:, 2] = np.unwrap(unknowns.poses[:, 2])
        return unknowns

    @property
    def normals(self) -> Array:
        """(w, 2): unit vectors to the walls."""
        return np.column_stack([np.cos(self.walls[:, 0]), np.sin(self.walls[:, 0])])


@dataclass(frozen=True, slots=True)
class Measured:
    """The record: k keyframes and n hits, as in `keyframes`."""

    dt_s: Array
    """(k - 1,)."""
    moved_frd_m: Array
    """(k - 1, 2)."""
    turned_rad: Array
    """(k - 1,)."""
    frame: Indices
    """(n,): of each hit its keyframe."""
    beam: Indices
    """(n,): its place in `BEAMS`."""
    offset_frd_m: Array
    """(n, 2)."""
    bearing_frd_rad: Array
    """(n,)."""
    distance_m: Array
    """(n,): from the sensor."""
    mount_offset_m: float
    """From the drone's centre to the sensor, along its beam."""

    @classmethod
    def of(
        cls, frames: Sequence[Keyframe], hits: Sequence[KeyframeHit], mount_offset_m: float
    ) -> "Measured":
        beam_at = {beam: i for i, beam in enumerate(BEAMS)}
        return cls(
            dt_s=np.diff([frame.time_s for frame in frames]),
            moved_frd_m=np.array([frame.moved_frd_m for frame in frames[1:]]).reshape(-1, 2),
            turned_rad=np.array([frame.turned_rad for frame in frames[1:]]),
            frame=np.array([hit.keyframe for hit in hits], dtype=np.int64),
            beam=np.array([beam_at[hit.beam] for hit in hits], dtype=np.int64),
            offset_frd_m=np.array([hit.offset_frd_m for hit in hits]).reshape(-1, 2),
            bearing_frd_rad=np.array([hit.bearing_frd_rad for hit in hits]),
            distance_m=np.array([hit.range_m for hit in hits]) - mount_offset_m,
            mount_offset_m=mount_offset_m,
        )


@dataclass(frozen=True, slots=True)
class Sightings:
    """The hits as the unknowns place them, local NED."""

    eyes: Array
    """(n, 2): where the drone was."""
    beams: Array
    """(n, 2): unit vectors along the beams."""
    points: Array
    """(n, 2): where the beams ended."""


def project(x: Unknowns, m: Measured) -> Sightings:
    """p_hit = p_k + R(ψ_k)·(1 + s)·q + (mount + (1 - γ_beam)·distance)·u(bearing)."""
    yaw = x.poses[m.frame, 2]
    cos_yaw, sin_yaw = np.cos(yaw), np.sin(yaw)
    forward, right = m.offset_frd_m.T * (1 + x.odometry_scale)
    moved = np.column_stack(
        [cos_yaw * forward - sin_yaw * right, sin_yaw * forward + cos_yaw * right]
    )
    eyes = x.poses[m.frame, :2] + moved
    bearing = yaw + m.bearing_frd_rad
    range_m = m.mount_offset_m + (1 - x.range_gain[m.beam]) * m.distance_m
    beams = np.column_stack([np.cos(bearing), np.sin(bearing)])
    return Sightings(eyes, beams, eyes + range_m[:, None] * beams)


class RangeNoise:
    """A sensor's noise, without what its unit's gain adds.

    Distances are compared as signals ς(d) = ∫ dd / σ(d), whose noise is 1 at any distance: for a
    Sharp sensor that is its voltage by its noise. There the noise is Gaussian, while distances
    computed from it are skewed, and a robust weight would pull towards the shorter ones.
    """

    STEP_M = 0.005

    def __init__(self, sensor: RangeModel) -> None:
        self.min_m, self.max_m, self.gain_sigma = sensor.min_m, sensor.max_m, sensor.gain_sigma
        steps = round((sensor.max_m - sensor.min_m) / self.STEP_M)
        distance_m = np.linspace(sensor.min_m, sensor.max_m, steps + 1)
        self._step_m = (sensor.max_m - sensor.min_m) / steps
        total_m = np.array([sensor.sigma_m(float(d)) for d in distance_m])
        self._sigma_m = np.sqrt(total_m**2 - (sensor.gain_sigma * distance_m) ** 2)
        per_step = 0.5 * self._step_m * (1 / self._sigma_m[1:] + 1 / self._sigma_m[:-1])
        self._signal = np.concatenate([[0.0], np.cumsum(per_step)])

    def sigma_m(self, distance_m: Array) -> Array:
        """Beyond the range, that at its end."""
        sigma: Array = self._sigma_m[np.rint(self._place(distance_m)).astype(np.int64)]
        return sigma

    def signal(self, distance_m: Array) -> Array:
        """ς above."""
        place = self._place(distance_m)
        low = np.minimum(place.astype(np.int64), len(self._signal) - 2)
        before, after = self._signal[low], self._signal[low + 1]
        signal: Array = before + (place - low) * (after - before)
        return signal

    def _place(self, distance_m: Array) -> Array:
        """In the tables; np.interp would search for it."""
        place: Array = (np.clip(distance_m, self.min_m, self.max_m) - self.min_m) / self._step_m
        return place
