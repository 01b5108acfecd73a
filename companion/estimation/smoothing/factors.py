"""The smoother's residuals, each divided by its sigma, with their gradients.

odometry   R(ψ_k)ᵀ(p_{k+1} + w_{k+1} - p_k - w_k) - (1 + s)·d_k
wander     w_{k+1} - w_k·exp(-dt/τ)
gyro       ψ_{k+1} - ψ_k - (1 - g)·G_k + b_k·dt
bias       b_{k+1} - b_k - m_k, m: change of the bias by the two gyros (`two_gyro_bias.py`)
hit        ς((1 - γ)·d) - ς(d_i),  d_i = (ρ_i - p·n_i) / cos(β - α_i) - mount
square     (α_i - α_j) - the nearest multiple of 90°, between walls at apparent right angles

The gradient by s is -mean(d)_k: the displacement averaged over some seconds (`odometry_model.py`).
"""

import math
from dataclasses import dataclass, field

import numpy as np

from companion.core.arrays import Array, Indices
from companion.estimation.filters.heading_filter import GyroModel
from companion.estimation.smoothing.bordered_solver import BorderedSystem, cauchy
from companion.estimation.smoothing.flight_record import FlightRecord
from companion.estimation.smoothing.odometry_model import OdometryModel, wander_kept
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import (
    CALIBRATION_SIZE,
    GAINS,
    GYRO_SCALE,
    ODOMETRY_SCALE,
    POSE_SIZE,
    WALL_SIZE,
    WANDER_EAST,
    WANDER_NORTH,
    Measured,
    Unknowns,
    project,
    unbiased_m,
)
from companion.estimation.smoothing.two_gyro_bias import AutopilotGyroModel, aided

MIN_SIGMA = 1e-4
"""Sigma of unknowns that are fixed by definition. Chosen: small, and the equations stay
solvable."""
SQUARE_SIGMA_RAD = math.radians(0.5)
"""Sigma of right angles in buildings, rad. Chosen."""


@dataclass(frozen=True, slots=True)
class Models:
    """Noise models of the sensors."""

    ranges: RangeUnits
    rest_bias_rad_s: float = 0.0
    """Bias of the gyro, averaged before take-off, rad/s."""
    gyro: GyroModel = field(default_factory=GyroModel)
    odometry: OdometryModel = field(default_factory=OdometryModel)
    autopilot_gyro: AutopilotGyroModel = field(default_factory=AutopilotGyroModel)

    def measured(self, record: FlightRecord) -> Measured:
        """All measurements so far, with the bias change from both gyros."""
        return aided(Measured.of(record, self.ranges), self.gyro, self.autopilot_gyro)

    def bias_variance(self, m: Measured) -> Array:
        """(k - 1,): variance of the change of the gyro's bias between keyframes, (rad/s)².

        With the autopilot's gyro as reference it is the variance of that gyro's bias. At take-off
        motor vibration adds the settling variance at once.
        """
        alone = self.gyro.bias_variance_per_s(m.age_s)
        per_s = np.where(m.is_aided, self.autopilot_gyro.bias_walk_rad_s_sqrt_s**2, alone)
        takes_off = m.is_aided & np.diff(m.is_aided, prepend=False)
        variance: Array = per_s * m.dt_s
        variance += np.where(takes_off, self.gyro.settling_variance(m.age_s), 0.0)
        return variance


def new_system(x: Unknowns, m: Measured) -> BorderedSystem:
    begins = [POSE_SIZE * frame for frame in m.begins]
    shared = x.calibration.size + x.walls.size
    return BorderedSystem(x.poses.size, shared, 2 * POSE_SIZE, begins)


def add_odometry(system: BorderedSystem, x: Unknowns, m: Measured, model: OdometryModel) -> None:
    moves, p = m.moves, x.poses
    at = POSE_SIZE * moves
    after = at + POSE_SIZE
    cos_yaw, sin_yaw = np.cos(p[moves, 2]), np.sin(p[moves, 2])
    north, east = np.diff(x.tracks, axis=0)[moves].T
    forward, right = cos_yaw * north + sin_yaw * east, cos_yaw * east - sin_yaw * north
    flight = m.flight[moves]
    reported_m = (1 + x.odometry_scale[flight, None]) * m.moved_frd_m[moves]
    scale, mean = CALIBRATION_SIZE * flight + ODOMETRY_SCALE, m.averaged_frd_m[moves]
    walk_m = model.step_sigma_m(m.dt_s)[moves]
    for by_pose, axis, to_north, to_east, by_yaw in (
        (forward, 0, cos_yaw, sin_yaw, right),
        (right, 1, -sin_yaw, cos_yaw, -forward),
    ):
        system.add(
            by_pose - reported_m[:, axis],
            walk_m,
            [
                *((at, -to_north), (at + 1, -to_east), (at + 2, by_yaw)),
                *((after, to_north), (after + 1, to_east)),
                *((at + WANDER_NORTH, -to_north), (at + WANDER_EAST, -to_east)),
                *((after + WANDER_NORTH, to_north), (after + WANDER_EAST, to_east)),
            ],
            [(scale, -mean[:, axis])],
        )


def wander_steps_m(x: Unknowns, m: Measured) -> Array:
    """(k - 1, 2): innovation of the wander, north and east; of no meaning between two flights."""
    wander_m = x.poses[:, WANDER_NORTH:]
    steps_m: Array = wander_m[1:] - wander_kept(m.dt_s)[:, None] * wander_m[:-1]
    return steps_m


def add_wander(system: BorderedSystem, x: Unknowns, m: Measured, model: OdometryModel) -> None:
    moves = m.moves
    at = POSE_SIZE * moves
    kept, sigma_m = wander_kept(m.dt_s)[moves], model.wander_step_sigma_m(m.dt_s)[moves]
    steps = wander_steps_m(x, m)[moves].T
    for axis, steps_m in zip((WANDER_NORTH, WANDER_EAST), steps, strict=True):
        system.add(
            steps_m,
            sigma_m,
            [(at + axis, -kept), (at + POSE_SIZE + axis, np.ones(len(at)))],
        )


def add_gyro(system: BorderedSystem, x: Unknowns, m: Measured, models: Models) -> None:
    moves, flight = m.moves, m.flight[m.moves]
    before, p = x.poses[moves], x.poses[moves + 1]
    at = POSE_SIZE * moves
    after = at + POSE_SIZE
    one = np.ones(len(at))
    dt_s, turned_rad = m.dt_s[moves], m.turned_rad[moves]
    system.add(
        p[:, 2] - before[:, 2] - (1 - x.gyro_scale[flight]) * turned_rad + before[:, 3] * dt_s,
        models.gyro.turn_sigma_rad(m.dt_s, m.gap_rad2)[moves],
        [(at + 2, -one), (after + 2, one), (at + 3, dt_s)],
        [(CALIBRATION_SIZE * flight + GYRO_SCALE, turned_rad)],
    )
    system.add(
        p[:, 3] - before[:, 3] - m.bias_moved_rad_s[moves],
        np.sqrt(models.bias_variance(m))[moves],
        [(at + 3, -one), (after + 3, one)],
    )


def hit_residuals(x: Unknowns, m: Measured, wall_of: Indices, units: RangeUnits) -> Array:
    """(hits on walls,): residuals of the hits, in sigmas of their ranges."""
    return _hits_on_walls(x, m, wall_of, units)[1]


def _hits_on_walls(
    x: Unknowns, m: Measured, wall_of: Indices, units: RangeUnits
) -> tuple[Indices, Array, Array, Array, Array]:
    """Indices of hits on walls, their residuals, expected distances, cos(incidence) and points."""
    used: Indices = np.flatnonzero(wall_of >= 0)
    rays = project(x, m)
    origins, beams = rays.origins[used], rays.beams[used]
    wall, beam = wall_of[used], m.beam[used]
    normals = x.normals[wall]
    cos_incidence = (beams * normals).sum(axis=1)
    expected_m = (x.walls[wall, 1] - (origins * normals).sum(axis=1)) / cos_incidence
    met = origins + expected_m[:, None] * beams
    distance_m = np.clip(expected_m - m.mount_m[used], units.min_m[beam], units.max_m[beam])
    residual = units.signal(beam, unbiased_m(x, m)[used]) - units.signal(beam, distance_m)
    return used, residual, distance_m, cos_incidence, met


def add_hits(
    system: BorderedSystem, x: Unknowns, m: Measured, wall_of: Indices, units: RangeUnits
) -> None:
    """A shift of the wall's line changes the expected range by the shift over cos(incidence)."""
    used, residual, distance_m, cos_incidence, met = _hits_on_walls(x, m, wall_of, units)
    wall, frame, beam = wall_of[used], m.frame[used], m.beam[used]
    per_sigma = 1 / (units.sigma_m(beam, distance_m) * cos_incidence)
    cos_a, sin_a = x.normals[wall].T
    arm = met - x.poses[frame, :2]
    pose_column, wall_column = POSE_SIZE * frame, x.calibration.size + WALL_SIZE * wall
    gain_column = CALIBRATION_SIZE * m.hit_flight[used] + GAINS + beam
    system.add(
        residual,
        cauchy(residual),
        [
            (pose_column, per_sigma * cos_a),
            (pose_column + 1, per_sigma * sin_a),
            (pose_column + 2, per_sigma * (arm[:, 0] * sin_a - arm[:, 1] * cos_a)),
        ],
        [
            (wall_column, per_sigma * (met[:, 1] * cos_a - met[:, 0] * sin_a)),
            (wall_column + 1, -per_sigma),
            (gain_column, -per_sigma * cos_incidence * distance_m),
        ],
    )


def off_square_rad(between_rad: Array) -> Array:
    """Deviation of angles between walls from the nearest multiple of 90°."""
    off_rad: Array = (between_rad + math.pi / 4) % (math.pi / 2) - math.pi / 4
    return off_rad


def add_square(system: BorderedSystem, x: Unknowns, wall: int, other: int) -> None:
    """Robust constraint: its weight falls with the deviation, as not every corner is square."""
    between_rad = x.walls[[wall], 0] - x.walls[[other], 0]
    residual = off_square_rad(between_rad) / SQUARE_SIGMA_RAD
    per_sigma, walls = np.array([1 / SQUARE_SIGMA_RAD]), x.calibration.size
    system.add(
        residual,
        cauchy(residual),
        [],
        [(walls + WALL_SIZE * wall, per_sigma), (walls + WALL_SIZE * other, -per_sigma)],
    )
