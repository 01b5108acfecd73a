"""Detects readings that have folded back: aliasing of a triangulating range sensor.

An obstacle nearer than half a metre reads as if it were a metre or more away. One reading alone is
ambiguous:

    signal      peak, at 0.5 m
            │   ╱╲
            │  ╱   ╲ _
            │ ╱        ` - . _             two distances give the same signal, and so the
            │╱ alias             ` - . _   same reading
            └──────────────────────────── distance

An obstacle that close was mostly detected earlier, or by another beam. So a reading whose alias
lies on a known point becomes TOO_NEAR. So does one whose alias lies on a wall of earlier flights: a
drone that takes off beside a wall has not detected it yet. At a corner that the drone passes
closely, an undetected wall can come near. There the signal passes the peak without a step, and no
recent beam has swept the place. The distance is then a guess with an error of up to two decimetres.
The signal also passes the peak when a beam turns away from a wall nearby. Then the readings
continue that wall in a straight line (`beam_track.py`), and have not folded back.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2, along
from companion.core.messages import (
    Beam,
    RangeModel,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
)
from companion.safety.beam_track import BeamTrack

ALIAS_M = 0.25
"""Maximum distance between the alias of a reading, or a guessed range, and a known point, m.
Chosen."""
ALIAS_ASIDE_M, ON_BEAM_M = 0.12, 0.05
"""A known point lies near a beam if it is closer to the beam than the first, and on it if it is
closer than the second and the drift, m. Chosen."""
KNOWN_M = 0.10
"""A reading within this distance of a known point has not folded back, m. Chosen."""
MAX_STEP_M = 0.08
"""Maximum change of the range along a beam from one sweep to the next, m. Chosen."""
AT_PEAK_M = 0.05
"""At the strongest signal, a reading and its alias differ by less than this, m: the obstacle was on
both sides of the peak. Chosen."""
PEAK_M = 0.15
"""Near the strongest signal, a reading and its alias differ by less than this, m. The obstacle may
then be on either side of the peak. Chosen."""
BEHIND_M, FREE_ASIDE_M, FREE_S = 0.15, 0.07, 6.0
"""A place is free if a beam reached the first distance behind it, m, within the second beside it,
m, less than the third ago, s. Chosen: beside a wall, odometry wanders by decimetres in ten
seconds."""
FREEING_BEAMS = 3
"""Beams that must show a place to be free. Chosen: the light of another drone's sensor makes single
readings too far, and one folded reading must not free the place of the next."""
HULL_M = 0.15
"""Space within this distance of a recent position of the drone's centre is free, m. Otherwise a
far reading beside an edge, which resembles a folded one, would create obstacles there. Chosen."""
Readings = Mapping[Beam, RangeReading]


@dataclass(frozen=True, slots=True)
class OnBeam:
    """What is known near a beam: distances from its sensor along it, m."""

    points_m: Array
    """(n,): to known points; their offset from the beam is up to `ALIAS_ASIDE_M`."""
    close_m: Array
    """(c,): to those of them that the beam meets, in spite of the drift."""
    wall_m: float
    """To the nearest wall of earlier flights; may be infinite."""

    @property
    def nearest_m(self) -> float:
        """To the nearest known point; may be infinite."""
        return float(self.points_m.min(initial=math.inf))

    def is_nearest_at(self, distance_m: float) -> bool:
        """Return True if the nearest point or wall lies at a distance."""
        return min(abs(self.nearest_m - distance_m), abs(self.wall_m - distance_m)) <= KNOWN_M

    def rather_explains(self, distance_m: float, alias_m: float) -> bool:
        """Return True if something known lies at the reading, and nothing exactly at its alias.

        A beam that passes an edge closely meets what is behind it.
        """
        is_at_reading = (np.abs(self.points_m - distance_m) <= KNOWN_M).any()
        is_at_reading |= abs(self.wall_m - distance_m) <= KNOWN_M
        close_m = np.append(self.close_m, self.wall_m)
        return bool(is_at_reading and (np.abs(close_m - alias_m) > KNOWN_M).all())


class FoldBackDetector:
    """Classifies the readings of each beam, in a frame that only odometry moves."""

    def __init__(self, units: Mapping[Beam, RangeUnit]) -> None:
        self._units = units
        self._near_m: dict[Beam, float] = {}
        """Least possible range of each beam that was too near in the last sweep, m."""
        self._over_peak: set[Beam] = set()
        """Those beams of which the obstacle may have been nearer than the signal's peak."""
        self._tracks = {beam: BeamTrack() for beam in units}
        self._followed: set[Beam] = set()
        """Beams that follow a straight wall in this sweep, and are believed for no other reason."""
        self._free_segments: deque[tuple[float, ...]] = deque()
        """Free segments of recent beams, oldest first: origin, unit vector, length m, time s."""
        self._now_s = 0.0
        self._ne_m: Vector2 = (0.0, 0.0)
        self._yaw_rad = 0.0

    def move_to(self, now_s: float, place_ne_m: Vector2, yaw_rad: float) -> None:
        """Set time, s, the drone's position, m, and heading, rad, in that frame."""
        self._now_s, self._ne_m, self._yaw_rad = now_s, place_ne_m, yaw_rad

    def unfolded(self, beam: Beam, reading: RangeReading, known: OnBeam) -> RangeReading:
        """Return TOO_NEAR if the reading has probably folded back; call once per sweep and beam."""
        model = self._units[beam].model
        alias_m, was_m = _alias_m(reading, model), self._near_m.pop(beam, math.nan)
        self._track(beam, reading.distance_m, alias_m)
        approaches = (
            beam in self._over_peak
            and abs(alias_m - was_m) < MAX_STEP_M
            and not known.is_nearest_at(reading.distance_m)
        )
        is_on_wall = _is_at(known.wall_m, reading, alias_m)
        if (approaches or is_on_wall) and self._freed_by(beam, alias_m) >= FREEING_BEAMS:
            approaches = is_on_wall = False
        self._followed.discard(beam)
        if approaches and self._tracks[beam].is_wall(self._ne_m):
            self._followed.add(beam)
            approaches = False
        has_folded = approaches or (
            (is_on_wall or _is_at(known.nearest_m, reading, alias_m))
            and not known.rather_explains(reading.distance_m, alias_m)
        )
        if reading.is_distance and has_folded:
            reading = RangeReading(RangeState.TOO_NEAR, alias_m)
        if reading.state is not RangeState.TOO_NEAR and beam not in self._followed:
            self._over_peak.discard(beam)
            self._tracks[beam].clear()
            return reading
        self._near_m[beam] = alias_m
        if reading.distance_m - alias_m < PEAK_M:
            self._over_peak.add(beam)
        return reading

    def _track(self, beam: Beam, distance_m: float, alias_m: float) -> None:
        """Add the end of the beam to its track, which begins at the peak of the signal."""
        track = self._tracks[beam]
        if math.isnan(alias_m) or distance_m - alias_m < AT_PEAK_M:
            track.clear()
        unit = self._units[beam]
        bearing_rad = self._yaw_rad + unit.bearing_frd_rad
        end_ne_m = along(self._ne_m, bearing_rad, distance_m + unit.offset_m)
        track.add(self._now_s, end_ne_m, self._yaw_rad)

    def _freed_by(self, beam: Beam, distance_m: float) -> int:
        """Return the number of sweeps and beams that show a place along the beam to be free.

        In a sweep the drone was there, or a beam reached `BEHIND_M` behind it. A beam that only
        passes it does not count: beams along a wall graze its corner.
        """
        unit_ne = np.array(self._unit_ne(beam))
        free = np.array(self._free_segments).reshape(-1, 6)
        off_m = self._ne_m - free[:, :2]
        off_m += (distance_m + self._units[beam].offset_m) * unit_ne
        was_there = (off_m * off_m).sum(axis=1) < HULL_M**2
        off_m += BEHIND_M * unit_ne
        along_m = (off_m * free[:, 2:4]).sum(axis=1)
        aside_m = np.abs(off_m[:, 0] * free[:, 3] - off_m[:, 1] * free[:, 2])
        through = (along_m > 0) & (along_m < free[:, 4] - FREE_ASIDE_M)
        return int((was_there | through & (aside_m < FREE_ASIDE_M)).sum())

    def record_free(self, now_s: float, raw: Readings, unfolded: Readings) -> None:
        """Store the free segment of each beam, also in front of an obstacle that is too near.

        A beam that only seems to follow a wall is left out: it would confirm itself.
        """
        free = self._free_segments
        while free and free[0][-1] <= now_s - FREE_S:
            free.popleft()
        for beam, unit in self._units.items():
            if beam not in raw or beam in self._followed:
                continue
            to_m = _free_length_m(raw[beam], unfolded[beam], unit.model) + unit.offset_m
            if to_m > FREE_ASIDE_M:
                free.append((*self._ne_m, *self._unit_ne(beam), to_m, now_s))

    def _unit_ne(self, beam: Beam) -> Vector2:
        bearing_rad = self._yaw_rad + self._units[beam].bearing_frd_rad
        return math.cos(bearing_rad), math.sin(bearing_rad)


def unfolded_up(scan: RangeScan, model: RangeModel, ceiling_m: float) -> RangeScan:
    """Return the scan with the up beam TOO_NEAR if its reading has probably folded back.

    `ceiling_m`: distance from the sensor to the ceiling, as measured from below, m; may be
    infinite.
    """
    reading = scan.readings.get(Beam.UP)
    if reading is None or not reading.is_distance:
        return scan
    alias_m = _alias_m(reading, model)
    if not _is_at(ceiling_m, reading, alias_m):
        return scan
    near = RangeReading(RangeState.TOO_NEAR, alias_m)
    return replace(scan, readings={**scan.readings, Beam.UP: near})


def _is_at(surface_m: float, reading: RangeReading, alias_m: float) -> bool:
    """Return True if the alias of a reading, rather than the reading, lies on a surface."""
    return abs(surface_m - alias_m) <= min(ALIAS_M, abs(surface_m - reading.distance_m))


def _alias_m(reading: RangeReading, model: RangeModel) -> float:
    """Return the nearer distance with the same signal, m; nan if the sensor has none."""
    alias_m = model.alias_m(reading.distance_m)
    return math.nan if alias_m is None else alias_m


def _free_length_m(raw: RangeReading, unfolded: RangeReading, model: RangeModel) -> float:
    """Return the length of the beam that is free, m; 0 if it is unknown."""
    if raw.state is RangeState.TOO_NEAR:
        least_m = _alias_m(raw, model)
        return 0.0 if math.isnan(least_m) else least_m
    if unfolded.is_distance:
        return unfolded.distance_m
    return model.max_m if unfolded.state is RangeState.NOTHING else 0.0
