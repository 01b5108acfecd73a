"""Rooms seen from a path, without a flight: beams in eight directions, with noise."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import points_to_frd
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import Rays, Unknowns
from companion.survey.evidence import Sight

Corners = Sequence[tuple[float, float]]
MAX_RANGE_M = 5.0
BEAMS = 8
SIGMA_M = 0.03

L_SHAPE: Corners = ((0, 0), (7, 0), (7, 4.5), (4.5, 4.5), (4.5, 6), (0, 6))
L_PATH: Corners = ((1, 1), (6, 1), (6, 3.5), (3.5, 3.5), (3.5, 5), (1, 5), (1, 1))
RECTANGLE: Corners = ((0, 0), (7, 0), (7, 5), (0, 5))
SQUARE: Corners = ((0, 0), (6, 0), (6, 6), (0, 6))


def inside(corners: Corners, stand_off_m: float = 1.0) -> Corners:
    """A path inside a rectangle."""
    (south, west), (north, east) = corners[0], corners[2]
    near = [(south, west), (north, west), (north, east), (south, east), (south, west)]
    middle = (south + north) / 2, (west + east) / 2
    return [
        (
            n + math.copysign(stand_off_m, middle[0] - n),
            e + math.copysign(stand_off_m, middle[1] - e),
        )
        for n, e in near
    ]


def sides(corners: Corners) -> Array:
    """(w, 2, 2): walls of a closed outline."""
    ends = np.array(corners, dtype=float)
    return np.stack([ends, np.roll(ends, -1, axis=0)], axis=1)


def seen(walls: Array, paths: Sequence[Corners], start: Array, seed: int = 0) -> Sight:
    """Walls (w, 2, 2) seen from paths, in the frame of a flight that began at `start` (3,)."""
    walls = _from_start(walls.reshape(-1, 2), start).reshape(-1, 2, 2)
    origins, beams = _views(_from_start(np.concatenate([_stations(path) for path in paths]), start))
    distance_m, wall_of = _cast(origins, beams, walls)
    wall_of[distance_m > MAX_RANGE_M] = NO_WALL
    noise_m = np.random.default_rng(seed).normal(0, SIGMA_M, len(distance_m))
    hits = wall_of != NO_WALL
    distance_m = np.where(hits, distance_m + noise_m, 0.0)
    points, none_of = origins + distance_m[:, None] * beams, np.zeros(len(origins), dtype=np.int64)
    rays = Rays(origins, beams, points, none_of, none_of)
    none = np.empty((0, 0))
    x = Unknowns(np.empty((0, 6)), _lines(walls, rays, wall_of), np.zeros((len(walls), 2)), none)
    return Sight.of(x, rays, np.full(len(distance_m), SIGMA_M), wall_of)


def _stations(path: Corners) -> Array:
    """Points every 0.2 m along a path."""
    ends = np.array(path, dtype=float)
    legs = []
    for begin, end in pairwise(ends):
        steps = max(1, round(float(np.hypot(*(end - begin))) / 0.2))
        legs.append(begin + np.linspace(0, 1, steps, endpoint=False)[:, None] * (end - begin))
    return np.concatenate(legs)


def _views(stations: Array) -> tuple[Array, Array]:
    """Origins and unit vectors of the beams at all stations; the drone turns as it goes."""
    turn = 0.05 * np.arange(len(stations))[:, None]
    bearing = (turn + np.arange(BEAMS) * math.tau / BEAMS).ravel()
    return np.repeat(stations, BEAMS, axis=0), np.column_stack([np.cos(bearing), np.sin(bearing)])


def _cast(origins: Array, beams: Array, walls: Array) -> tuple[Array, Indices]:
    """Distance to the first wall, and its number."""
    along = walls[:, 1] - walls[:, 0]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    towards = beams @ across.T
    gap = (walls[:, 0] * across).sum(axis=1) - origins @ across.T
    with np.errstate(divide="ignore", invalid="ignore"):
        distance_m = gap / towards
        met = origins[:, None] + distance_m[..., None] * beams[:, None]
        share = ((met - walls[:, 0]) * along).sum(axis=2) / (along**2).sum(axis=1)
    distance_m[~((distance_m > 0) & (share >= 0) & (share <= 1))] = np.inf
    return distance_m.min(axis=1), distance_m.argmin(axis=1)


def _lines(walls: Array, rays: Rays, wall_of: Indices) -> Array:
    """(w, 2): normal direction, away from the drone, and offset of each wall."""
    lines = np.zeros((len(walls), 2))
    for number, (begin, end) in enumerate(walls):
        normal = np.array([-(end - begin)[1], (end - begin)[0]]) / np.hypot(*(end - begin))
        on_wall = np.flatnonzero(wall_of == number)
        if len(on_wall) and normal @ rays.beams[on_wall[0]] < 0:
            normal = -normal
        lines[number] = math.atan2(normal[1], normal[0]), normal @ begin
    return lines


def _from_start(points: Array, start: Array) -> Array:
    """Points (n, 2) in the frame of a flight that began at `start` (3,)."""
    return points_to_frd(points - start[:2], float(start[2]))
