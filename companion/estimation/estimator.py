"""Estimates pose and walls: calls the filters and the smoother in order, once a tick."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from companion.core.frames import Vector2, along, frd_to_ned, moved, ned_to_frd, wrap_rad
from companion.core.known_walls import KnownWalls
from companion.core.messages import (
    Beam,
    GyroSample,
    Odometry,
    Pose,
    RangeReading,
    RangeScan,
    RangeUnit,
    WallLine,
)
from companion.estimation.association.pruning import Support
from companion.estimation.filter_reset import restart
from companion.estimation.filters.dead_reckoning import DeadReckoning
from companion.estimation.filters.heading_filter import HeadingFilter, WallBearing
from companion.estimation.filters.height_filter import Height
from companion.estimation.filters.position_filter import LineSlam, max_direction_range_m
from companion.estimation.filters.wall_runs import Line, RunHit, WallRun
from companion.estimation.hypotheses.search import most_likely
from companion.estimation.smoothing.estimate import EarlierWalls, Estimate, MarginalPrior
from companion.estimation.smoothing.factors import SQUARE_SIGMA_RAD, Models
from companion.estimation.smoothing.flight_record import FlightRecord, HitColumn
from companion.estimation.smoothing.odometry_noise import OdometryNoise
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits
from companion.estimation.smoothing.sliding_window import InFlightSmoothing, Walls
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import (
    POSE_SIZE,
    Measured,
    Unknowns,
    normals_of,
)
from companion.estimation.solved_flight import SolvedFlight

MAX_OBLIQUE_RAD = math.radians(30)
"""Largest incidence at which a wall counts as lying along a bearing, rad. Chosen."""
MAX_EXTENSION_M = 1.0
"""A wall may extend this far beyond its last hit, m. Chosen."""
AUTOPILOT_YAW_LASTS_S = 0.15
"""An autopilot heading older than this is not used, s: three odometry messages at 20 Hz."""
COMPASS_STEP_RAD = math.radians(3)
"""A larger step between autopilot and gyro heading in one message is a compass reset, rad.
Chosen."""
AIRBORNE_M = 0.1
"""Above this height the drone is in the air, m. Chosen."""
SQUARE_WITHIN_RAD = math.radians(5)
"""Walls within this angle of a right angle are assumed to be perpendicular, rad. Chosen."""


class Estimator:
    """Estimates pose and walls. Origin and heading are those at the start."""

    def __init__(
        self,
        rest_bias_rad_s: float,
        units: Mapping[Beam, RangeUnit],
        earlier: EarlierWalls | None = None,
    ) -> None:
        """`units`: the horizontal range sensors; `earlier`: walls known from earlier flights."""
        self._units = units
        self.models = Models(RangeUnits(units), rest_bias_rad_s)
        self.heading = HeadingFilter(rest_bias_rad_s)
        self.slam = LineSlam(self.heading, self.models.odometry)
        self._noise = OdometryNoise(self.models.odometry)
        self._max_direction_range_m = {
            beam: max_direction_range_m(unit.model) for beam, unit in units.items()
        }
        self.velocity_frd_m_s: Vector2 = (0.0, 0.0)
        """Velocity by the last odometry, forward and right, m/s."""
        self._yaw_rate_rad_s = 0.0
        self._turned_until_s = 0.0
        self.record = FlightRecord()
        self._smoother = Smoother(self.models, Support())
        self._earlier = earlier
        self._in_flight = InFlightSmoothing(self.models, earlier)
        self._resets = 0
        self._runs = {beam: WallRun() for beam in units}
        self._odometry: Odometry | None = None
        self._height_m = 0.0
        self._over_floor = Height()
        self._raw = DeadReckoning()
        """Dead reckoning by uncorrected gyro and odometry."""
        self._autopilot_ahead_rad, self._odometry_s = 0.0, -math.inf
        """Autopilot heading less raw heading at the last odometry message, rad; time of that
        message."""
        self._autopilot_on_ground_rad = 0.0
        """Autopilot turn before take-off, rad."""
        self.dead_reckoning = DeadReckoning()
        """Dead reckoning by gyro and odometry, with the corrections known at the time; no steps."""
        self._solution: tuple[Measured, Estimate] | None = None
        if earlier is not None:
            self._begin_among(earlier)

    @property
    def knows_earlier_flights(self) -> bool:
        """True if the flight began with the walls of earlier flights, in their frame."""
        return self._earlier is not None

    def _begin_among(self, earlier: EarlierWalls) -> None:
        """Start the filters with the walls of earlier flights."""
        x = Unknowns.at(np.zeros((1, 3)), self.models.rest_bias_rad_s)
        x.add_walls(earlier.walls, earlier.reach_m)
        information = self._prior().gaussian.information
        covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        restart(self.heading, self.slam, x, covariance)

    def _prior(self) -> MarginalPrior:
        """The prior of the whole flight."""
        return self._smoother.from_start(np.zeros(3), earlier=self._earlier)

    def pose(self, time_s: float) -> Pose:
        return Pose(
            time_s,
            *self.slam.position_ne_m,
            down_m=-self._height_m,
            yaw_rad=self.heading.yaw_rad,
            position_sigma_m=self.slam.position_sigma_m,
            yaw_sigma_rad=self.heading.yaw_sigma_rad,
            reset_counter=self._resets,
        )

    @property
    def height_m(self) -> float:
        """Height above the take-off point by the autopilot's estimate, by which it flies, m."""
        return self._height_m

    @property
    def over_floor_m(self) -> float:
        """Height above the take-off point, corrected by the down beam, m.

        Height maps use this value.
        """
        return self._over_floor.metres

    def turn(self, samples: Sequence[GyroSample]) -> None:
        """Integrate gyro samples."""
        corrected_rad, raw_rad = self.heading.predict(samples)
        self.record.bridge(sum(sample.turn_variance_rad2 for sample in samples))
        if samples:
            self._yaw_rate_rad_s = samples[-1].yaw_rate_rad_s - self.heading.bias_rad_s
            self._turned_until_s = samples[-1].time_s
        self.dead_reckoning.turn(corrected_rad)
        self._raw.turn(raw_rad)

    def move(self, odometry: Odometry) -> None:
        """Integrate the autopilot's odometry. Only the displacement of the body is used.

        `safety/health/odometry.py` has removed jumps.
        """
        last, self._odometry = self._odometry, odometry
        if last is None or odometry.time_s <= last.time_s:
            return
        dt_s = odometry.time_s - last.time_s
        (x, y, z), (last_x, last_y, last_z) = odometry.position_ned_m, last.position_ned_m
        north_m, east_m = x - last_x, y - last_y
        self._height_m -= z - last_z
        self._over_floor.move(last_z - z, dt_s)
        self.velocity_frd_m_s = ned_to_frd(*odometry.velocity_ned_m_s[:2], odometry.yaw_rad)
        half_turn_rad = 0.5 * wrap_rad(odometry.turned_rad - last.turned_rad)
        body_m = ned_to_frd(north_m, east_m, odometry.yaw_rad - half_turn_rad)
        self.slam.move(frd_to_ned(*body_m, self.heading.yaw_rad - half_turn_rad), dt_s)
        self._raw.move(body_m, half_turn_rad)
        if not odometry.follows_us:
            self._update_autopilot_heading(odometry)
        scale = 1 + self.slam.scale_error
        self.dead_reckoning.move((scale * body_m[0], scale * body_m[1]), half_turn_rad)

    def _update_autopilot_heading(self, odometry: Odometry) -> None:
        """Update the difference between autopilot and raw heading, unwrapped to the last value."""
        ahead_s = odometry.time_s - self._turned_until_s
        raw_rad = self._raw.yaw_rad + ahead_s * self._yaw_rate_rad_s
        change_rad = wrap_rad(odometry.turned_rad - raw_rad - self._autopilot_ahead_rad)
        self._autopilot_ahead_rad += change_rad
        self._odometry_s = odometry.time_s
        if self._height_m < AIRBORNE_M:
            self._autopilot_on_ground_rad = raw_rad + self._autopilot_ahead_rad
        elif abs(change_rad) > COMPASS_STEP_RAD:
            self._autopilot_on_ground_rad += change_rad

    def _autopilot_yaw_rad(self, now_s: float) -> float:
        """The autopilot's turn since take-off, rad.

        NaN on the ground or without recent odometry.
        """
        if self._height_m < AIRBORNE_M or now_s - self._odometry_s > AUTOPILOT_YAW_LASTS_S:
            return math.nan
        return self._raw.yaw_rad + self._autopilot_ahead_rad - self._autopilot_on_ground_rad

    def see(self, scan: RangeScan) -> None:
        """Process one scan of the horizontal beams."""
        self._solution = None
        pose = self.pose(scan.time_s)
        self.record.advance(
            pose, self._raw.ne_m, self._raw.yaw_rad, self._autopilot_yaw_rad(scan.time_s)
        )
        for beam, unit in self._units.items():
            reading = scan.readings.get(beam)
            if reading is None:
                continue
            if not reading.is_distance:
                self._add_run(self._runs[beam].end(), scan.time_s)
                continue
            # extrapolated from the last odometry and gyro sample to the time of measurement
            measured_s = scan.time_s - unit.model.mean_age_s
            late_s = measured_s - self._odometry.time_s if self._odometry else 0.0
            shift_m = late_s * self.velocity_frd_m_s[0], late_s * self.velocity_frd_m_s[1]
            ahead_rad = (measured_s - self._turned_until_s) * self._yaw_rate_rad_s
            range_m = reading.distance_m + unit.offset_m
            yaw_rad = self.heading.yaw_rad
            centre_ne_m = moved(self.slam.position_ne_m, shift_m, yaw_rad)
            bearing_frd_rad = ahead_rad + unit.bearing_frd_rad
            wall = self.slam.correct_by_range(centre_ne_m, yaw_rad + bearing_frd_rad, range_m, unit)
            measured_at = shift_m, bearing_frd_rad
            if wall is not None:
                self.slam.walls[wall].measured_s = scan.time_s
            number = BEAMS.index(beam)
            self.record.add_hit(pose, number, reading.distance_m, measured_at, wall, late_s=late_s)
            if reading.distance_m > self._max_direction_range_m[beam]:
                continue
            yaw_rad = self.dead_reckoning.yaw_rad + ahead_rad
            drifting_ne_m = moved(self.dead_reckoning.ne_m, shift_m, self.dead_reckoning.yaw_rad)
            hit_ne_m = along(drifting_ne_m, yaw_rad + unit.bearing_frd_rad, range_m)
            self._learn_odometry_noise(beam, wall, scan.time_s, (hit_ne_m, reading.variance_m2))
            drifting_hit = RunHit(
                scan.time_s,
                hit_ne_m,
                reading.variance_m2,
                drifting_ne_m,
                yaw_rad,
                self.models.odometry.wander_m,
            )
            self._add_run(self._runs[beam].add(drifting_hit), scan.time_s)

    def _learn_odometry_noise(
        self, beam: Beam, wall: int | None, time_s: float, hit: tuple[Vector2, float]
    ) -> None:
        """Estimate the odometry noise from a hit in the drifting frame, with its variance."""
        (hit_ne_m, variance_m2), normal_rad = hit, 0.0
        if wall is not None:
            turn_rad = self.heading.yaw_rad - self.dead_reckoning.yaw_rad
            normal_rad = self.heading.normal_rad(wall) - turn_rad
        self._noise.add_hit(BEAMS.index(beam), wall, time_s, (hit_ne_m, normal_rad, variance_m2))

    def see_floor(self, reading: RangeReading, offset_m: float) -> None:
        """Correct the height by the down beam, whose sensor sits `offset_m` below the centre."""
        self._over_floor.see_floor(reading, offset_m)

    def smoothed(self) -> SolvedFlight | None:
        """Smooth the whole flight; None if there are fewer than two keyframes."""
        if len(self.record.frames) < 2:
            return None
        try:
            _, done = self.solved()
        except np.linalg.LinAlgError:
            return self.so_far()
        return SolvedFlight.of(
            self.record, done.x, done.wall_lines, done.wall_of, self.models.ranges
        )

    def solved(self) -> tuple[Measured, Estimate]:
        """The measurements of the whole flight, and their most likely solution; made once.

        Raises:
            LinAlgError: the equations cannot be solved.
        """
        if self._solution is None:
            m = self._smoother.models.measured(self.record)
            x, walls = self._as_flown(), self.walls()
            x.add_walls(walls.lines, walls.reach_m)
            x.odometry_scale[:] = 0.0
            self._solution = m, most_likely(self._smoother, x, m, self._prior())
        return self._solution

    def so_far(self) -> SolvedFlight:
        """The flight by the current estimate, without a new smoothing."""
        wall_of = self.record.hits[:, HitColumn.WALL].astype(np.int64)
        return SolvedFlight.of(
            self.record, self._as_flown(), self.wall_lines(), wall_of, self.models.ranges
        )

    def _as_flown(self) -> Unknowns:
        x = Unknowns.at(self.record.poses, self.models.rest_bias_rad_s)
        x.odometry_scale[:] = self.slam.scale_error
        return x

    def improve(self, now_s: float) -> None:
        """Do one piece of the in-flight smoothing; after the last, the filters restart from it.

        Pose and walls make a step then.
        """
        done = self._in_flight.step(now_s, self.record, self.walls)
        if done is None:
            return
        covariance = done.estimate.solution.covariance_of_last(POSE_SIZE)
        restart(self.heading, self.slam, done.estimate.x, covariance)
        x, wall_of = done.estimate.x, done.estimate.wall_of
        self.record.correct(done.first, x.poses[:, :3], done.first_hit, wall_of)
        north_m, east_m = (
            now - then for now, then in zip(self._raw.ne_m, done.raw_ne_m, strict=True)
        )
        body_m = ned_to_frd(north_m, east_m, done.raw_yaw_rad)
        self.slam.move(frd_to_ned(*body_m, self.heading.yaw_rad), now_s - done.time_s)
        turned_rad = self._raw.yaw_rad - done.raw_yaw_rad
        gap_rad2 = self.record.bridged_since_rad2(done.time_s)
        self.heading.turn(turned_rad, self._turned_until_s - done.time_s, gap_rad2)
        self._resets += 1

    def _add_run(self, run: Line | None, now_s: float) -> None:
        """Correct the heading by a finished run. A run on no known wall adds a wall."""
        if run is None:
            return
        bearing = self._wall_bearing(run, now_s)
        line = self._to_local(run)
        known = self.slam.find(line)
        if known is not None:
            self.heading.correct_by_wall(known.index, bearing)
            return
        index = self.heading.add_wall(bearing)
        self._align_to_right_angle(index)
        self.slam.add(line, index)

    def _wall_bearing(self, run: Line, now_s: float) -> WallBearing:
        """The bearing of the run's normal in the body frame, in the middle of the run."""
        age_s = now_s - run.mean_time_s
        corrected_rad = self.dead_reckoning.yaw_rad - run.mean_yaw_rad
        raw_rad = corrected_rad + self.heading.bias_rad_s * age_s
        raw_rad /= 1 - self.heading.scale_error
        bearing_frd_rad = run.normal_rad - run.mean_yaw_rad
        return WallBearing(bearing_frd_rad, run.normal_sigma_rad, raw_rad, age_s)

    def _align_to_right_angle(self, wall: int) -> None:
        """Constrain a new wall that is nearly square to the most certain wall to a right angle."""
        if wall == 0:
            return
        most_certain = min(range(wall), key=self.heading.normal_sigma_rad)
        angle_rad = self.heading.normal_rad(wall) - self.heading.normal_rad(most_certain)
        off_square_rad = wrap_rad(4 * angle_rad) / 4
        if abs(off_square_rad) < SQUARE_WITHIN_RAD:
            self.heading.align_to_right_angle(wall, most_certain, SQUARE_SIGMA_RAD)

    def _to_local(self, run: Line) -> Line:
        """Transform a run from the drifting frame to local NED by the two current poses."""
        turn_rad = wrap_rad(self.heading.yaw_rad - self.dead_reckoning.yaw_rad)
        ahead_m = run.centre[0] - self.dead_reckoning.ne_m[0]
        aside_m = run.centre[1] - self.dead_reckoning.ne_m[1]
        north_m, east_m = frd_to_ned(ahead_m, aside_m, turn_rad)
        north_m += self.slam.position_ne_m[0]
        east_m += self.slam.position_ne_m[1]
        normal_rad = wrap_rad(run.normal_rad + turn_rad)
        offset_m = north_m * math.cos(normal_rad) + east_m * math.sin(normal_rad)
        return replace(run, normal_rad=normal_rad, offset_m=offset_m, centre=(north_m, east_m))

    def wall_ahead(self, bearing_rad: float) -> tuple[float, float] | None:
        """(normal_rad, distance_m along the normal) of the nearest known wall along a bearing."""
        north_m, east_m = self.slam.position_ne_m
        nearest: tuple[float, float] | None = None
        for index in self.heading.facing(bearing_rad, MAX_OBLIQUE_RAD):
            wall = self.slam.walls[index]
            normal_rad, offset_m = self.slam.line(wall)
            cos_n, sin_n = math.cos(normal_rad), math.sin(normal_rad)
            distance_m = offset_m - north_m * cos_n - east_m * sin_n
            north, east = north_m - wall.anchor_ne_m[0], east_m - wall.anchor_ne_m[1]
            along_m = cos_n * east - sin_n * north + distance_m * math.tan(bearing_rad - normal_rad)
            met = distance_m > 0 and wall.reaches(along_m, MAX_EXTENSION_M)
            if met and (nearest is None or distance_m < nearest[1]):
                nearest = normal_rad, distance_m
        return nearest

    def known_walls(self) -> KnownWalls:
        """All walls, for the missions."""
        walls = self.walls()
        normals = normals_of(walls.lines)
        covariance_m2 = self.slam.offsets_covariance_m2
        measured_s = np.array([wall.measured_s for wall in self.slam.walls])
        return KnownWalls(normals, walls.lines[:, 1], walls.reach_m, covariance_m2, measured_s)

    def wall_lines(self) -> tuple[WallLine, ...]:
        """All walls, for the map."""
        return tuple(
            WallLine(*self.slam.line(wall), self.slam.offset_sigma_m(wall))
            for wall in self.slam.walls
        )

    def walls(self) -> Walls:
        """All walls, for the smoother."""
        return Walls(*self.slam.lines_and_reach())
