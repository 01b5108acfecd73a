"""The smoother's residuals, each divided by its sigma, with their gradients.

odometry   R(ψ_k)ᵀ(p_{k+1} - p_k) - (1 + s)·d_k
gyro       ψ_{k+1} - ψ_k - (1 - g)·G_k + b_k·dt
bias       b_{k+1} - b_k
hit        ς((1 - γ)·d) - ς(d_i),  d_i = (ρ_i - p·n_i) / cos(β - α_i) - mount
priors     p_0 = 0, ψ_0 = 0 (the frame's own definition), b_0, g, s, γ
"""

from dataclasses import dataclass

import numpy as np

from companion.estimation.bordered import BorderedSystem
from companion.estimation.heading import GyroModel
from companion.estimation.line_slam import OdometryModel
from companion.estimation.unknowns import (
    BEAMS,
    POSE_SIZE,
    WALL_SIZE,
    Indices,
    Measured,
    RangeNoise,
    Unknowns,
    project,
)

GYRO_SCALE, ODOMETRY_SCALE, GAINS = 0, 1, 2
WALLS = GAINS + len(BEAMS)
"""Places of the shared unknowns."""
CAUCHY_SIGMAS = 2.0
ODOMETRY_FLOOR_M = 0.002
"""What rounding and the messages' timing add to a step."""
LEAST_SIGMA = 1e-4


@dataclass(frozen=True, slots=True)
class Models:
    """How far the sensors may be trusted."""

    ranges: RangeNoise
    rest_bias_rad_s: float
    """The gyro's, as averaged before take-off."""
    gyro: GyroModel
    odometry: OdometryModel


def new_system(x: Unknowns) -> BorderedSystem:
    return BorderedSystem(x.poses.size, WALLS + x.walls.size, 2 * POSE_SIZE)


def add_odometry(system: BorderedSystem, x: Unknowns, m: Measured, model: OdometryModel) -> None:
    p = x.poses
    at = POSE_SIZE * np.arange(len(p) - 1)
    after = at + POSE_SIZE
    cos_yaw, sin_yaw = np.cos(p[:-1, 2]), np.sin(p[:-1, 2])
    north, east = (p[1:, :2] - p[:-1, :2]).T
    forward, right = cos_yaw * north + sin_yaw * east, cos_yaw * east - sin_yaw * north
    walk_m = np.sqrt(model.step_variance_m2_per_s * m.dt_s) + ODOMETRY_FLOOR_M
    for by_pose, moved, to_north, to_east, by_yaw in (
        (forward, m.moved_frd_m[:, 0], cos_yaw, sin_yaw, right),
        (right, m.moved_frd_m[:, 1], -sin_yaw, cos_yaw, -forward),
    ):
        system.add(
            by_pose - (1 + x.odometry_scale) * moved,
            walk_m,
            [
                *((at, -to_north), (at + 1, -to_east), (at + 2, by_yaw)),
                *((after, to_north), (after + 1, to_east)),
            ],
            [(ODOMETRY_SCALE, -moved)],
        )


def add_gyro(system: BorderedSystem, x: Unknowns, m: Measured, model: GyroModel) -> None:
    p = x.poses
    at = POSE_SIZE * np.arange(len(p) - 1)
    after = at + POSE_SIZE
    one = np.ones(len(at))
    system.add(
        p[1:, 2] - p[:-1, 2] - (1 - x.gyro_scale) * m.turned_rad + p[:-1, 3] * m.dt_s,
        model.rate_noise_rad_s_sqrt_hz * np.sqrt(m.dt_s),
        [(at + 2, -one), (after + 2, one), (at + 3, m.dt_s)],
        [(GYRO_SCALE, m.turned_rad)],
    )
    system.add(
        p[1:, 3] - p[:-1, 3],
        np.sqrt(model.bias_variance_per_s(np.cumsum(m.dt_s)) * m.dt_s),
        [(at + 3, -one), (after + 3, one)],
    )


def add_priors(
    system: BorderedSystem,
    x: Unknowns,
    models: Models,
) -> None:
    gyro, odometry, gain_sigma = models.gyro, models.odometry, models.ranges.gain_sigma
    one = np.ones(1)
    first = x.poses[0] - (0.0, 0.0, 0.0, models.rest_bias_rad_s)
    sigmas = LEAST_SIGMA, LEAST_SIGMA, LEAST_SIGMA, gyro.bias_sigma_rad_s
    for column, sigma in enumerate(sigmas):
        system.add(first[column : column + 1], sigma, [(np.array([column]), one)])
    shared = [
        (GYRO_SCALE, x.gyro_scale, gyro.scale_sigma),
        (ODOMETRY_SCALE, x.odometry_scale, odometry.scale_sigma),
        *((GAINS + i, gain, gain_sigma + LEAST_SIGMA) for i, gain in enumerate(x.range_gain)),
    ]
    for column, value, sigma in shared:
        system.add(np.array([value]), sigma, [], [(np.array([column]), one)])


def add_hits(
    system: BorderedSystem,
    x: Unknowns,
    m: Measured,
    wall_of: Indices,
    noise: RangeNoise,
) -> None:
    """Where the wall's line moves, the expected range moves by 1 / cos(incidence) of it."""
    used = np.flatnonzero(wall_of >= 0)
    seen = project(x, m)
    eyes, beams = seen.eyes[used], seen.beams[used]
    wall, frame, beam = wall_of[used], m.frame[used], m.beam[used]
    normals = x.normals[wall]
    cos_incidence = (beams * normals).sum(axis=1)
    expected_m = (x.walls[wall, 1] - (eyes * normals).sum(axis=1)) / cos_incidence
    met = eyes + expected_m[:, None] * beams
    distance_m = np.clip(expected_m - m.mount_offset_m, noise.min_m, noise.max_m)
    residual = noise.signal((1 - x.range_gain[beam]) * m.distance_m[used]) - noise.signal(
        distance_m
    )
    per_sigma = 1 / (noise.sigma_m(distance_m) * cos_incidence)
    cos_a, sin_a = normals.T
    arm = met - x.poses[frame, :2]
    pose_column, wall_column = POSE_SIZE * frame, WALLS + WALL_SIZE * wall
    system.add(
        residual,
        np.sqrt(1 + (residual / CAUCHY_SIGMAS) ** 2),
        [
            (pose_column, per_sigma * cos_a),
            (pose_column + 1, per_sigma * sin_a),
            (pose_column + 2, per_sigma * (arm[:, 0] * sin_a - arm[:, 1] * cos_a)),
        ],
        [
            (wall_column, per_sigma * (met[:, 1] * cos_a - met[:, 0] * sin_a)),
            (wall_column + 1, -per_sigma),
            (GAINS + beam, -per_sigma * cos_incidence * distance_m),
        ],
    )
