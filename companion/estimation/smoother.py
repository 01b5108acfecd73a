"""The whole flight at once: the trajectory and walls that all measurements together make likeliest.

The filters must decide at every moment; after the flight a wall seen early can be set right by what
was seen late. Unknowns, solved together by Gauss-Newton on sparse normal equations:

    keyframes k: position p_k, heading ψ_k, gyro bias b_k      gyro scale g, odometry scale s
    walls i: direction of the normal α_i, offset ρ_i           wall i: {p : p·n(α_i) = ρ_i}

Residuals, each divided by its sigma:

    odometry   R(ψ_k)ᵀ(p_{k+1} - p_k) - (1 + s)·d_k
    gyro       ψ_{k+1} - ψ_k - (1 - g)·G_k + b_k·dt
    bias       b_{k+1} - b_k
    hit        (p_k + R(ψ_k)·q)·n_i - ρ_i
    priors     p_0 and ψ_0 (from take-off to the first range), b_0, g, s

Which hit belongs to which wall is decided anew in every round, with an ever narrower gate; walls
that turn out to be one are merged, walls that too little speaks for are dropped. A Cauchy weight
keeps what still does not fit from pulling.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from companion.estimation.heading import GyroModel
from companion.estimation.keyframes import Keyframe, KeyframeHit
from companion.estimation.line_slam import OdometryModel
from companion.frames import wrap_rad
from companion.messages import Hit, Pose, RangeModel, WallLine

Array = NDArray[np.float64]

GATES_M = (0.6, 0.4, 0.3, 0.2, 0.1, 0.1, 0.05, 0.05, 0.05, 0.05)
"""How far off its wall a hit may be in each round, besides three sigmas."""
GATE_SIGMAS = 3.0
STEPS_A_ROUND = 2
LEAST_COS_INCIDENCE = math.cos(math.radians(70))
EXTENT_MARGIN_M = 3.0
CAUCHY_SIGMAS = 2.0
SAME_DIRECTION_RAD = math.radians(8)
SAME_PLACE_M = 0.35
LEAST_HITS = 12
LEAST_EXTENT_M = 0.6
NEAR_END_SIGMAS = 2.0
ODOMETRY_FLOOR_M = 0.002
LEAST_SIGMA = 1e-4
POSE_SIZE = 4


@dataclass(frozen=True, slots=True)
class Smoothed:
    """The flight as it most likely was."""

    walls: tuple[WallLine, ...]
    hits: tuple[Hit, ...]
    path: tuple[Pose, ...]
    odometry_scale_error: float
    gyro_scale_error: float


@dataclass(slots=True)
class _State:
    poses: Array
    """(k, 4): north, east, yaw, gyro bias."""
    walls: Array
    """(w, 2): direction of the normal, offset."""
    gyro_scale: float = 0.0
    odometry_scale: float = 0.0


@dataclass(frozen=True, slots=True)
class _Measured:
    """The record as arrays."""

    dt_s: Array
    moved: Array
    turned: Array
    frame: NDArray[np.int64]
    offset: Array
    bearing: Array
    range_m: Array
    start: Pose


class Smoother:
    """Smooths one flight; the result does not depend on anything but the record."""

    def __init__(
        self,
        sensor: RangeModel,
        mount_offset_m: float,
        rest_bias_rad_s: float,
    ) -> None:
        self._sensor = sensor
        self._mount_offset_m = mount_offset_m
        self._rest_bias_rad_s = rest_bias_rad_s
        self._gyro = GyroModel()
        self._odometry = OdometryModel()

    def smooth(
        self,
        frames: Sequence[Keyframe],
        hits: Sequence[KeyframeHit],
        walls: Sequence[WallLine],
    ) -> Smoothed:
        """The likeliest flight, beginning from the filters' poses and walls."""
        measured = _as_arrays(frames, hits)
        state = _State(
            np.array(
                [[f.guess.north_m, f.guess.east_m, 0.0, self._rest_bias_rad_s] for f in frames]
            ),
            np.array([[w.normal_rad, w.offset_m] for w in walls]).reshape(-1, 2),
        )
        state.poses[:, 2] = np.unwrap([f.guess.yaw_rad for f in frames])
        for gate_m in GATES_M:
            wall_of, sigma = self._associate(state, measured, gate_m)
            wall_of = _merge_and_drop(state, measured, wall_of)
            for _ in range(STEPS_A_ROUND):
                information = self._step(state, measured, wall_of, sigma)
        points, _, _ = _project(state, measured)
        return Smoothed(
            _wall_lines(state, information),
            tuple(map(self._hit, hits, points)),
            tuple(map(_pose, frames, state.poses)),
            state.odometry_scale,
            state.gyro_scale,
        )

    def _hit(self, hit: KeyframeHit, point: Array) -> Hit:
        sigma_m = self._sensor.sigma_m(max(hit.range_m - self._mount_offset_m, self._sensor.min_m))
        position_ned_m = (float(point[0]), float(point[1]), hit.down_m)
        return Hit(hit.time_s, hit.beam, position_ned_m, sigma_m**2)

    def _associate(
        self, state: _State, m: _Measured, gate_m: float
    ) -> tuple[NDArray[np.int64], Array]:
        """For each hit its wall (or -1) and the sigma of its distance from the wall."""
        if not len(m.range_m) or not len(state.walls):
            return np.full(len(m.range_m), -1), np.ones(len(m.range_m))
        points, eye, bearing = _project(state, m)
        normals = _normals(state.walls)
        cos_incidence = np.cos(bearing[:, None] - state.walls[:, 0])
        usable = cos_incidence > LEAST_COS_INCIDENCE
        distance = state.walls[:, 1] - eye @ normals.T
        expected = distance / np.where(usable, cos_incidence, 1.0) - self._mount_offset_m
        in_range = np.clip(expected, self._sensor.min_m, self._sensor.max_m)
        sigma_range = _vectorised_sigma(self._sensor, in_range)
        # Near the end of the range long readings are missing, which would pull walls closer.
        usable &= expected < self._sensor.max_m - NEAR_END_SIGMAS * sigma_range
        usable &= distance > 0
        across = points @ normals.T - state.walls[:, 1]
        sigma = np.maximum(sigma_range * cos_incidence, 1e-3)
        usable &= np.abs(across) < gate_m + GATE_SIGMAS * sigma
        misfit = np.where(usable, np.abs(across) / sigma, np.inf)
        wall_of = misfit.argmin(axis=1)
        rows = np.arange(len(points))
        wall_of = np.where(np.isfinite(misfit[rows, wall_of]), wall_of, -1)
        return wall_of, sigma[rows, wall_of]

    def _step(
        self, state: _State, m: _Measured, wall_of: NDArray[np.int64], sigma: Array
    ) -> "splu":
        """One Gauss-Newton step; the factorised information matrix."""
        system = _System(len(state.poses), len(state.walls))
        self._add_motion(system, state, m)
        _add_hits(system, state, m, wall_of, sigma)
        step, factor = system.solve()
        size = POSE_SIZE * len(state.poses)
        state.poses += step[:size].reshape(-1, POSE_SIZE)
        state.gyro_scale += step[size]
        state.odometry_scale += step[size + 1]
        state.walls += step[size + 2 :].reshape(-1, 2)
        return factor

    def _add_motion(self, system: "_System", state: _State, m: _Measured) -> None:
        p, gyro, start = state.poses, self._gyro, m.start
        k = np.arange(len(p) - 1)
        at, after = POSE_SIZE * k, POSE_SIZE * (k + 1)
        cos_yaw, sin_yaw = np.cos(p[:-1, 2]), np.sin(p[:-1, 2])
        north, east = (p[1:, :2] - p[:-1, :2]).T
        forward, right = cos_yaw * north + sin_yaw * east, cos_yaw * east - sin_yaw * north
        walk_m = np.sqrt(self._odometry.step_variance_m2_per_s * m.dt_s) + ODOMETRY_FLOOR_M
        scale = 1 + state.odometry_scale
        for residual, moved, to_north, to_east, by_yaw in (
            (forward, m.moved[:, 0], cos_yaw, sin_yaw, right),
            (right, m.moved[:, 1], -sin_yaw, cos_yaw, -forward),
        ):
            system.add(
                residual - scale * moved,
                walk_m,
                [
                    *((at, -to_north), (at + 1, -to_east), (at + 2, by_yaw)),
                    *((after, to_north), (after + 1, to_east)),
                    (system.odometry_scale, -moved),
                ],
            )
        one = np.ones(len(k))
        turn = p[1:, 2] - p[:-1, 2] - (1 - state.gyro_scale) * m.turned + p[:-1, 3] * m.dt_s
        system.add(
            turn,
            gyro.rate_noise_rad_s_sqrt_hz * np.sqrt(m.dt_s),
            [(at + 2, -one), (after + 2, one), (at + 3, m.dt_s), (system.gyro_scale, m.turned)],
        )
        system.add(
            p[1:, 3] - p[:-1, 3],
            gyro.bias_walk_rad_s_sqrt_s * np.sqrt(m.dt_s),
            [(at + 3, -one), (after + 3, one)],
        )
        for column, value, prior_sigma in (
            (0, p[0, 0] - start.north_m, start.position_sigma_m + LEAST_SIGMA),
            (1, p[0, 1] - start.east_m, start.position_sigma_m + LEAST_SIGMA),
            (2, p[0, 2] - start.yaw_rad, start.yaw_sigma_rad + LEAST_SIGMA),
            (3, p[0, 3] - self._rest_bias_rad_s, gyro.bias_sigma_rad_s),
            (system.gyro_scale, state.gyro_scale, gyro.scale_sigma),
            (system.odometry_scale, state.odometry_scale, self._odometry.scale_sigma),
        ):
            system.add(np.array([value]), prior_sigma, [(np.array([column]), np.ones(1))])


def _pose(frame: Keyframe, pose: Array) -> Pose:
    north_m, east_m, yaw_rad, _ = map(float, pose)
    return replace(frame.guess, north_m=north_m, east_m=east_m, yaw_rad=wrap_rad(yaw_rad))


def _wall_lines(state: _State, information: "splu") -> tuple[WallLine, ...]:
    first = POSE_SIZE * len(state.poses) + 2
    return tuple(
        WallLine(float(normal), float(offset), math.sqrt(_variance(information, first + 2 * i + 1)))
        for i, (normal, offset) in enumerate(state.walls)
    )


class _System:
    """Sparse linear system being collected: rows of residuals over columns of unknowns."""

    def __init__(self, poses: int, walls: int) -> None:
        self.gyro_scale = POSE_SIZE * poses
        self.odometry_scale = self.gyro_scale + 1
        self.first_wall = self.gyro_scale + 2
        self._size = self.first_wall + 2 * walls
        self._rows: list[NDArray[np.int64]] = []
        self._columns: list[NDArray[np.int64]] = []
        self._values: list[Array] = []
        self._residuals: list[Array] = []
        self._count = 0

    def add(
        self,
        residual: Array,
        sigma: Array | float,
        gradient: list[tuple[NDArray[np.int64] | int, Array]],
    ) -> None:
        """Rows of one kind: residuals (n,), their sigmas, and (columns (n,), d residual/d x)."""
        rows = self._count + np.arange(len(residual))
        self._count += len(residual)
        self._residuals.append(residual / sigma)
        for column, value in gradient:
            self._rows.append(rows)
            self._columns.append(np.broadcast_to(column, rows.shape))
            self._values.append(value / sigma)

    def solve(self) -> tuple[Array, "splu"]:
        """The Gauss-Newton step -(JᵀJ)⁻¹ Jᵀr, and the factorised JᵀJ."""
        shape = self._count, self._size
        places = np.concatenate(self._rows), np.concatenate(self._columns)
        jacobian = coo_matrix((np.concatenate(self._values), places), shape=shape).tocsc()
        information = (jacobian.T @ jacobian).tocsc()
        # Positive definite: pivots stay on the diagonal, or the band of the poses would be lost.
        factor = splu(
            information,
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        step: Array = -factor.solve(jacobian.T @ np.concatenate(self._residuals))
        return step, factor


def _add_hits(
    system: _System, state: _State, m: _Measured, wall_of: NDArray[np.int64], sigma: Array
) -> None:
    used = np.flatnonzero(wall_of >= 0)
    if not len(used):
        return
    points, _, _ = _project(state, m)
    wall, frame, points = wall_of[used], m.frame[used], points[used]
    alpha, offset = state.walls[wall].T
    cos_a, sin_a = np.cos(alpha), np.sin(alpha)
    residual = points[:, 0] * cos_a + points[:, 1] * sin_a - offset
    arm = points - state.poses[frame, :2]
    misfit = residual / sigma[used]
    robust = sigma[used] * np.sqrt(1 + (misfit / CAUCHY_SIGMAS) ** 2)
    column, wall_column = POSE_SIZE * frame, system.first_wall + 2 * wall
    system.add(
        residual,
        robust,
        [
            *((column, cos_a), (column + 1, sin_a)),
            (column + 2, arm[:, 0] * sin_a - arm[:, 1] * cos_a),
            (wall_column, points[:, 1] * cos_a - points[:, 0] * sin_a),
            (wall_column + 1, -np.ones(len(used))),
        ],
    )


def _project(state: _State, m: _Measured) -> tuple[Array, Array, Array]:
    """Hits (n, 2), where the drone was (n, 2) and the bearings (n,), all in local NED."""
    yaw = state.poses[m.frame, 2]
    cos_yaw, sin_yaw = np.cos(yaw), np.sin(yaw)
    forward, right = m.offset.T * (1 + state.odometry_scale)
    eye = state.poses[m.frame, :2] + np.column_stack(
        [cos_yaw * forward - sin_yaw * right, sin_yaw * forward + cos_yaw * right]
    )
    bearing = yaw + m.bearing
    points = eye + m.range_m[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    return points, eye, bearing


def _merge_and_drop(state: _State, m: _Measured, wall_of: NDArray[np.int64]) -> NDArray[np.int64]:
    """Make one of walls that are one, leave out walls without support; the hits' walls anew."""
    points, _, _ = _project(state, m)
    support = np.bincount(wall_of[wall_of >= 0], minlength=len(state.walls))
    kept: list[int] = []
    becomes = np.full(len(state.walls) + 1, -1)  # the last entry is for hits without a wall
    for wall in np.argsort(-support, kind="stable"):
        mine = points[wall_of == wall]
        if support[wall] < LEAST_HITS or _extent(mine, state.walls[wall]) < LEAST_EXTENT_M:
            continue
        twin = next((k for k in kept if _is_same(state.walls[k], state.walls[wall], mine)), None)
        if twin is None:
            kept.append(int(wall))
            becomes[wall] = len(kept) - 1
        else:
            becomes[wall] = becomes[twin]
    state.walls = state.walls[kept].reshape(-1, 2)
    renumbered: NDArray[np.int64] = becomes[wall_of]
    return renumbered


def _extent(points: Array, wall: Array) -> float:
    along = points @ np.array([-math.sin(wall[0]), math.cos(wall[0])])
    return float(np.ptp(along)) if len(along) else 0.0


def _is_same(wall: Array, other: Array, points_of_other: Array) -> bool:
    if abs(wrap_rad(float(wall[0] - other[0]))) > SAME_DIRECTION_RAD:
        return False
    across = points_of_other @ np.array([math.cos(wall[0]), math.sin(wall[0])]) - wall[1]
    return bool(abs(np.median(across)) < SAME_PLACE_M)


def _normals(walls: Array) -> Array:
    return np.column_stack([np.cos(walls[:, 0]), np.sin(walls[:, 0])])


def _vectorised_sigma(sensor: RangeModel, distance_m: Array) -> Array:
    """The sensor's sigma at many distances, from a table: it is a smooth enough function."""
    table_m = np.linspace(sensor.min_m, sensor.max_m, 200)
    table = np.array([sensor.sigma_m(float(d)) for d in table_m])
    sigma: Array = np.interp(distance_m, table_m, table)
    return sigma


def _variance(factor: "splu", column: int) -> float:
    unit = np.zeros(factor.shape[0])
    unit[column] = 1.0
    return float(factor.solve(unit)[column])


def _as_arrays(frames: Sequence[Keyframe], hits: Sequence[KeyframeHit]) -> _Measured:
    return _Measured(
        dt_s=np.diff([frame.time_s for frame in frames]),
        moved=np.array([frame.moved_frd_m for frame in frames[1:]]).reshape(-1, 2),
        turned=np.array([frame.turned_rad for frame in frames[1:]]),
        frame=np.array([hit.keyframe for hit in hits], dtype=np.int64),
        offset=np.array([hit.offset_frd_m for hit in hits]).reshape(-1, 2),
        bearing=np.array([hit.bearing_frd_rad for hit in hits]),
        range_m=np.array([hit.range_m for hit in hits]),
        start=frames[0].guess,
    )
