"""What the smoother needs of the flight: a pose every 0.2 s, what was measured between, and hits.

All in frames that nothing estimated has touched: displacements and hits are relative to the
keyframe before them, by raw odometry and gyro.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from companion.estimation.dead_reckoning import moved
from companion.frames import Vector2, ned_to_frd
from companion.messages import Beam, Pose
from companion.values import value

PERIOD_S = 0.2


@value
class Keyframe:
    """A moment of the flight. Motion is from the keyframe before, in that one's body frame."""

    time_s: float
    guess: Pose
    """The filters' pose at that time."""
    moved_frd_m: Vector2
    """By odometry, its scale not corrected."""
    turned_rad: float
    """By the gyro, neither bias nor scale corrected."""


@value
class KeyframeHit:
    """One return of a beam, relative to its keyframe's position and heading."""

    time_s: float
    beam: Beam
    keyframe: int
    offset_frd_m: Vector2
    """Where the drone was."""
    bearing_frd_rad: float
    """Where the beam pointed, off the keyframe's heading."""
    range_m: float
    """From the drone's centre."""
    down_m: float


@dataclass(slots=True)
class Keyframes:
    """The record."""

    frames: list[Keyframe] = field(default_factory=list)
    hits: list[KeyframeHit] = field(default_factory=list)
    _raw_ne_m: Vector2 = (0.0, 0.0)
    _raw_yaw_rad: float = 0.0
    _moved_frd_m: Vector2 = (0.0, 0.0)
    _turned_rad: float = 0.0
    """Since the latest keyframe."""

    @property
    def raw(self) -> tuple[Vector2, float]:
        """Raw dead-reckoned place and yaw of the last keyframe."""
        return self._raw_ne_m, self._raw_yaw_rad

    def correct(self, path: Sequence[Pose]) -> None:
        """Better guesses for the keyframes from the first on."""
        for i, pose in enumerate(path):
            self.frames[i] = replace(self.frames[i], guess=pose)

    def advance(self, pose: Pose, raw_ne_m: Vector2, raw_yaw_rad: float) -> None:
        """The drone is here by now, and there by uncorrected dead reckoning."""
        north_m, east_m = raw_ne_m[0] - self._raw_ne_m[0], raw_ne_m[1] - self._raw_ne_m[1]
        self._moved_frd_m = ned_to_frd(north_m, east_m, self._raw_yaw_rad)
        self._turned_rad = raw_yaw_rad - self._raw_yaw_rad
        if self.frames and pose.time_s - self.frames[-1].time_s < PERIOD_S - 1e-6:
            return
        self.frames.append(Keyframe(pose.time_s, pose, self._moved_frd_m, self._turned_rad))
        self._raw_ne_m, self._raw_yaw_rad = raw_ne_m, raw_yaw_rad
        self._moved_frd_m, self._turned_rad = (0.0, 0.0), 0.0

    def add_hit(
        self,
        pose: Pose,
        beam: Beam,
        bearing_frd_rad: float,
        range_m: float,
        back: tuple[Vector2, float],
    ) -> None:
        """A hit read now, so far off the nose.

        `back` is the motion from now, forward and right, and the turn, to when it was measured.
        """
        self.hits.append(
            KeyframeHit(
                pose.time_s,
                beam,
                len(self.frames) - 1,
                moved(self._moved_frd_m, back[0], self._turned_rad),
                self._turned_rad + back[1] + bearing_frd_rad,
                range_m,
                pose.down_m,
            )
        )
