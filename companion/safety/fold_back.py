"""Readings of a triangulating sensor that have folded back.

What is nearer than half a metre reads as if it were a metre or more away. From one reading nobody
can tell:

    signal      peak, at 0.5 m
            │   ╱╲
            │  ╱   ╲ _
            │ ╱        ` - . _             the same signal, and so the same reading, from two
            │╱ alias             ` - . _   distances
            └──────────────────────────── distance

But what comes so near was mostly met before, or by another beam: a reading whose alias lies on a
point that is known is called too near. Round a corner that is passed closely a wall comes near that
was never met: there the beam goes on over the peak without a step, and no beam has looked there a
moment ago. How near it is remains a guess, wrong by up to two decimetres.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import Vector2
from companion.core.messages import Beam, RangeModel, RangeReading, RangeState, RangeUnit

ALIAS_M = 0.25
"""So well must a folded reading, or a guess of how near it is, fit a point that is known."""
KNOWN_M = 0.10
"""What fits a point that is known as well as this has not folded back."""
GOES_ON_M = 0.08
"""By no more does what a beam meets come nearer from one sweep to the next."""
PEAK_M = 0.15
"""About the strongest signal what is too near may be on either side of it, this far apart."""
BEHIND_M, LOOKED_ASIDE_M, LOOKED_S = 0.15, 0.07, 6.0
"""If a beam has gone through so far behind a place, so near to it and so lately, nothing stands
there. Not longer ago: beside a wall odometry wanders by decimetres in ten seconds."""
HULL_M = 0.15
"""Nor does anything stand so near to where the drone's centre was a moment ago: what beside an edge
reads far, and seems to have folded, would follow it."""
Array = NDArray[np.float64]
Readings = Mapping[Beam, RangeReading]


class Folds:
    """What tells of each beam whether it has folded back; in a frame that only odometry moves."""

    def __init__(self, units: Mapping[Beam, RangeUnit]) -> None:
        self._units = units
        self._near_m: dict[Beam, float] = {}
        """Of what was too near a sweep ago: how near it was, at least,"""
        self._over_peak: set[Beam] = set()
        """and whether it may have been nearer than where the signal is strongest."""
        self._looked: Array = np.empty((0, 6))
        """(r, 6): what beams went through a moment ago; from where, unit vector, how far, when."""
        self._ne_m: Vector2 = (0.0, 0.0)
        self._yaw_rad = 0.0

    def move_to(self, place_ne_m: Vector2, yaw_rad: float) -> None:
        """Where the drone is, in its own frame."""
        self._ne_m, self._yaw_rad = place_ne_m, yaw_rad

    def unfolded(self, beam: Beam, reading: RangeReading, known_m: float) -> RangeReading:
        """Too near, if it is likely that the reading has folded back; once for each sweep.

        `known_m` is from the sensor to the nearest thing known along its beam, or infinite.
        """
        model = self._units[beam].model
        alias_m, was_m = _alias_m(reading, model), self._near_m.pop(beam, math.nan)
        off_m, alias_off_m = abs(known_m - reading.distance_m), abs(known_m - alias_m)
        comes_near = beam in self._over_peak and abs(alias_m - was_m) < GOES_ON_M
        has_folded = alias_off_m <= min(ALIAS_M, off_m) or (
            comes_near and off_m > KNOWN_M and not self._is_free(beam, alias_m)
        )
        if reading.is_distance and has_folded:
            reading = RangeReading(RangeState.TOO_NEAR, alias_m)
        if reading.state is not RangeState.TOO_NEAR:
            self._over_peak.discard(beam)
            return reading
        self._near_m[beam] = alias_m
        if reading.distance_m - alias_m < PEAK_M:
            self._over_peak.add(beam)
        return reading

    def _is_free(self, beam: Beam, distance_m: float) -> bool:
        """At a place so far from a sensor, along its beam, nothing stands.

        The drone was there, or beams have gone through what lies behind it. Not only past it: along
        a wall beams graze its corner.
        """
        unit_ne = self._unit_ne(beam)
        off_m = self._ne_m - self._looked[:, :2]
        off_m += (distance_m + self._units[beam].offset_m) * unit_ne
        was_there = (off_m * off_m).sum(axis=1) < HULL_M**2
        off_m += BEHIND_M * unit_ne
        along_m = (off_m * self._looked[:, 2:4]).sum(axis=1)
        aside_m = np.abs(off_m[:, 0] * self._looked[:, 3] - off_m[:, 1] * self._looked[:, 2])
        through = (along_m > 0) & (along_m < self._looked[:, 4] - LOOKED_ASIDE_M)
        return bool((was_there | through & (aside_m < LOOKED_ASIDE_M)).any())

    def look(self, now_s: float, raw: Readings, unfolded: Readings) -> None:
        """Note what the beams went through, also before what is too near by its signal."""
        looked = []
        for beam, unit in self._units.items():
            if beam not in raw:
                continue
            to_m = _went_m(raw[beam], unfolded[beam], unit.model) + unit.offset_m
            if to_m > LOOKED_ASIDE_M:
                looked.append((*self._ne_m, *self._unit_ne(beam), to_m, now_s))
        lately = self._looked[self._looked[:, 5] > now_s - LOOKED_S]
        self._looked = np.vstack([lately, *looked]) if looked else lately

    def _unit_ne(self, beam: Beam) -> Array:
        bearing_rad = self._yaw_rad + self._units[beam].bearing_frd_rad
        return np.array((math.cos(bearing_rad), math.sin(bearing_rad)))


def _alias_m(reading: RangeReading, model: RangeModel) -> float:
    """The least distance that reads the same; nan if there is none nearer than its least."""
    alias_m = model.alias_m(reading.distance_m)
    return math.nan if alias_m is None else alias_m


def _went_m(raw: RangeReading, unfolded: RangeReading, model: RangeModel) -> float:
    """So far from the sensor its beam met nothing; 0 if that is not known."""
    if raw.state is RangeState.TOO_NEAR:
        least_m = _alias_m(raw, model)
        return 0.0 if math.isnan(least_m) else least_m
    if unfolded.is_distance:
        return unfolded.distance_m
    return model.max_m if unfolded.state is RangeState.NOTHING else 0.0
