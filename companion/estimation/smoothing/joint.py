"""Joins several flights into one record with shared walls.

The keyframes of the flights follow each other in one chain. No motion leads from one flight to the
next: only walls, and what is known of the starts, connect them. So the band of the equations falls
apart into one band for each flight, and the border holds the walls and each flight's calibration:

    [ A₁       B₁ ]        A₁, A₂: bands of the flights
    [     A₂   B₂ ]
    [ B₁ᵀ B₂ᵀ  C  ]        C: calibration of each flight, walls
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from companion.core.arrays import Array
from companion.estimation.smoothing.estimate import MarginalPrior
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import (
    EAST,
    NORTH,
    WANDER_EAST,
    WANDER_NORTH,
    YAW,
    Measured,
    Unknowns,
    to_ned,
    walls_moved_to,
)

Number = TypeVar("Number", bound=np.generic)
PAUSE_S = 60.0
"""Time between two flights in the joint record, s. Chosen: longer than the pauses after which the
association takes hits for a new visit, or contradictions for two."""


@dataclass(frozen=True, slots=True)
class PlacedFlight:
    """A flight, its solution in the frame of the survey, and what is known of its start."""

    m: Measured
    x: Unknowns
    pad: Array
    """(3,): north, east, yaw at which the first keyframe is expected."""
    pad_sigma: Array
    """(3,): sigmas of the pad; those of the first flight of a survey are not used."""
    rest_bias_rad_s: float = 0.0
    """Bias of the gyro, averaged before take-off, rad/s."""


def joined(
    smoother: Smoother, flights: Sequence[PlacedFlight]
) -> tuple[Measured, Unknowns, MarginalPrior]:
    """All flights as one record, with initial values and the prior on their starts."""
    m = _joined_record([flight.m for flight in flights])
    x = Unknowns(
        poses=np.concatenate([each.x.poses for each in flights]),
        walls=np.concatenate([each.x.walls for each in flights]),
        reach_m=np.concatenate([each.x.reach_m for each in flights]),
        calibration=np.concatenate([each.x.calibration for each in flights]),
    )
    later = tuple(
        smoother.start_prior(frame, flight.pad, flight.pad_sigma, flight.rest_bias_rad_s)
        for frame, flight in zip(m.begins[1:], flights[1:], strict=True)
    )
    return m, x, smoother.from_start(flights[0].pad, later)


def moved_to(x: Unknowns, start: Array) -> Unknowns:
    """Unknowns of a flight from (0, 0, 0), moved and turned so that it begins at `start` (3,)."""
    turned = x.since(0)
    yaw = np.full(len(x.poses), start[YAW])
    turned.poses[:, NORTH : EAST + 1] = start[:YAW] + to_ned(x.poses[:, NORTH : EAST + 1], yaw)
    turned.poses[:, YAW] += start[YAW]
    wander = slice(WANDER_NORTH, WANDER_EAST + 1)
    turned.poses[:, wander] = to_ned(x.poses[:, wander], yaw)
    turned.walls, turned.reach_m = walls_moved_to(start, x.walls, x.reach_m)
    return turned


def _joined_record(flights: Sequence[Measured]) -> Measured:
    begins = np.cumsum([0, *(len(m.dt_s) + 1 for m in flights[:-1])])
    dt_s = _motions([m.dt_s for m in flights])
    dt_s[begins[1:] - 1] = PAUSE_S
    return Measured(
        dt_s=dt_s,
        age_s=_motions([m.age_s for m in flights]),
        moved_frd_m=_motions([m.moved_frd_m for m in flights]),
        turned_rad=_motions([m.turned_rad for m in flights]),
        autopilot_yaw_rad=np.concatenate([m.autopilot_yaw_rad for m in flights]),
        bias_moved_rad_s=_motions([m.bias_moved_rad_s for m in flights]),
        is_aided=_motions([m.is_aided for m in flights]),
        frame=np.concatenate([m.frame + at for m, at in zip(flights, begins, strict=True)]),
        beam=np.concatenate([m.beam for m in flights]),
        offset_frd_m=np.concatenate([m.offset_frd_m for m in flights]),
        bearing_rad=np.concatenate([m.bearing_rad for m in flights]),
        distance_m=np.concatenate([m.distance_m for m in flights]),
        mount_m=np.concatenate([m.mount_m for m in flights]),
        averaged_frd_m=_motions([m.averaged_frd_m for m in flights]),
        gap_rad2=_motions([_or_zeros(m.gap_rad2, len(m.dt_s)) for m in flights]),
        late_s=np.concatenate([_or_zeros(m.late_s, len(m.frame)) for m in flights]),
        height_m=np.concatenate([_or_zeros(m.height_m, len(m.frame)) for m in flights]),
        begins=tuple(begins.tolist()),
    ).with_levels()


def _motions(rows: Sequence[NDArray[Number]]) -> NDArray[Number]:
    """Motions of all flights, with a row of zeros from each flight to the next."""
    between = np.zeros_like(rows[0], shape=(1, *rows[0].shape[1:]))
    return np.concatenate([each for row in rows for each in (row, between)][:-1])


def _or_zeros(values: Array | None, count: int) -> Array:
    return np.zeros(count) if values is None else values
