"""Places a flight in the map of earlier flights, from an approximate start.

A start on the same pad is a few centimetres and degrees off. Over ten metres three degrees are half
a metre, more than the association's gates. So the walls of the flight are matched with those of the
map first, by least squares over the start (δn, δe, δψ):

    direction   α_flight + δψ - α_map
    offset      distance of the middle of the flight's wall from the map's wall
    start       (δn, δe, δψ) by its sigmas

A wall is matched with the nearest wall that faces the same way and overlaps it. A wall that the map
does not contain has no match, or a residual that the Cauchy loss limits.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import wrap_rad
from companion.estimation.smoothing.bordered_solver import cauchy
from companion.estimation.smoothing.joint import moved_to
from companion.estimation.smoothing.state import YAW, Unknowns

ROUNDS = 12
"""Rounds of matching and least squares. Chosen."""
MAX_TURN_RAD, MAX_APART_M = math.radians(12), 0.8
"""Largest difference of direction, rad, and of offset, m, of a match. Chosen: a default start is up
to 9° off (three sigmas), which moves a wall at 5 m by 0.8 m; 3° are the wall's own error."""
DIRECTION_SIGMA_RAD, OFFSET_SIGMA_M = math.radians(1.0), 0.08
"""Sigmas of the residuals: error of a wall within its flight. Chosen."""
MIN_OVERLAP_M = 0.3
"""Least overlap of two walls along them, m. Chosen."""


def refined_start(flight: Unknowns, known: Unknowns, start: Array, sigma: Array) -> Array:
    """(3,): the start (north, east, yaw) for which the walls of a flight fit the known walls best.

    `flight` is in the flight's own frame. `start` and `sigma` (3,): the start so far, and its
    standard deviations.
    """
    refined = start.copy()
    for _ in range(ROUNDS):
        rows = [*_residuals(moved_to(flight, refined), known, refined)]
        residuals = np.array([(refined - start) / sigma]).ravel()
        jacobian = np.diag(1 / sigma)
        if rows:
            residual = np.array([row[0] for row in rows])
            weight = 1 / cauchy(residual)
            residuals = np.concatenate([residuals, weight * residual])
            gradient = np.array([row[1] for row in rows])
            jacobian = np.concatenate([jacobian, weight[:, None] * gradient])
        step, *_ = np.linalg.lstsq(jacobian, -residuals, rcond=None)
        refined = refined + step
    return refined


@dataclass(frozen=True, slots=True)
class Match:
    """A wall of a flight, and the known wall nearest to it."""

    wall: int
    known: int
    turn_rad: float
    """Direction of the known wall, from that of the flight's wall."""
    apart_m: float
    """Distance of the middle of the flight's wall beyond the known wall."""
    middle_ne_m: Array
    """(2,): middle of the flight's wall."""


def matches(placed: Unknowns, known: Unknowns) -> Iterator[Match]:
    """The walls of a flight that have a known wall near, with the nearest one."""
    for wall, (normal, tangent) in enumerate(zip(placed.normals, placed.tangents, strict=True)):
        normal_rad = float(placed.walls[wall, 0])
        middle = placed.walls[wall, 1] * normal + placed.reach_m[wall].mean() * tangent
        turn_rad = wrap_rad(known.walls[:, 0] - normal_rad)
        apart_m = known.normals @ middle - known.walls[:, 1]
        along_m = known.tangents @ middle
        half_m = 0.5 * float(np.ptp(placed.reach_m[wall]))
        overlap_m = np.minimum(along_m + half_m, known.reach_m[:, 1]) - np.maximum(
            along_m - half_m, known.reach_m[:, 0]
        )
        fits = (np.abs(turn_rad) < MAX_TURN_RAD) & (np.abs(apart_m) < MAX_APART_M)
        fits &= overlap_m > MIN_OVERLAP_M
        if not fits.any():
            continue
        nearest = int(np.where(fits, np.abs(apart_m), np.inf).argmin())
        yield Match(wall, nearest, float(turn_rad[nearest]), float(apart_m[nearest]), middle)


def _residuals(placed: Unknowns, known: Unknowns, start: Array) -> Iterator[tuple[float, Array]]:
    """Residuals of the matched walls, in sigmas, with their gradients (3,) by the start."""
    for match in matches(placed, known):
        by_turn = np.array([0.0, 0.0, 1.0])
        yield -match.turn_rad / DIRECTION_SIGMA_RAD, by_turn / DIRECTION_SIGMA_RAD
        normal, arm = known.normals[match.known], match.middle_ne_m - start[:YAW]
        by_offset = np.array([*normal, normal @ (-arm[1], arm[0])])
        yield match.apart_m / OFFSET_SIGMA_M, by_offset / OFFSET_SIGMA_M
