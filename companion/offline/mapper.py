"""Maps a log: estimates in one batch, and uses the odometry alone if the result is doubtful."""

from dataclasses import dataclass, replace

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import wrap_rad
from companion.core.messages import Beam, FloorPlan, Hit, Pose
from companion.estimation.association.pruning import Support
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import project
from companion.mapping.floor_plan import MIN_OPENING_M, wall_segments
from companion.offline.conventions import likelier_axes
from companion.offline.growth import IncrementalMap
from companion.offline.held_out import gains, mean_gain, predicts_better
from companion.offline.odometry_path import OdometryPath
from companion.offline.path_error import expected_error_m
from companion.offline.ranges import horizontal_beams, usable_ranges
from companion.offline.reading.log import Log, Watch, ignore
from companion.offline.reading.sensors import SensorsConfig
from companion.offline.record import Record, poses_of_rows, to_record
from companion.offline.scale import with_supported_scale
from companion.offline.verdict import Agreement, Correction, MapVerdict, agreement, judge

ROWS_TO_OPEN = 2.5
"""Least width of an opening, in steps between rows. Chosen."""
MIN_WORTH = 30.0
"""χ² that a wall must save (`Support.worth`). Chosen."""
MIN_STEP_M = 0.01
"""Shorter steps are no motion, m. Chosen."""


@dataclass(frozen=True, slots=True)
class LogMap:
    """Result for one log."""

    log: Log
    jumps: int
    """Number of jumps of the odometry."""
    path: Array
    """(rows, 3): north, east, yaw, in the frame of the log's odometry."""
    plan: FloorPlan
    verdict: MapVerdict
    agreement: Agreement
    """Agreement of ranges and odometry with this map."""
    odometry_agreement: Agreement
    """The same for the map by uncorrected odometry."""
    odometry_scale_error: float
    gyro_scale_error: float


def map_log(log: Log, sensors: SensorsConfig, watch: Watch) -> LogMap:
    """The best map that the log supports."""
    axes = likelier_axes(
        log,
        lambda changed: _odometry_gain(changed, sensors),
        lambda changed: map_part(changed, sensors, ignore).agreement.gain,
    )
    return map_part(log, sensors, watch, axes)


def _odometry_gain(log: Log, sensors: SensorsConfig) -> float:
    """Gain of the map by uncorrected odometry, nats per range (`held_out.py`)."""
    beams = horizontal_beams(log, sensors)
    record = to_record(log, beams)
    units = RangeUnits({beam: one.unit for beam, one in beams.items()})
    return mean_gain(gains(_held_to_odometry(record, units, _support(log)), record.measured, units))


def map_part(log: Log, sensors: SensorsConfig, watch: Watch, axes: str | None = None) -> LogMap:
    """Map a log with the axes that it has; `axes`: what to change, if others are likelier."""
    beams = horizontal_beams(log, sensors)
    record, support = to_record(log, beams), _support(log)
    units = RangeUnits({beam: one.unit for beam, one in beams.items()})
    odometry_path = _held_to_odometry(record, units, support)
    estimate = IncrementalMap(Smoother(Models(units), support), record.measured, log.odometry[0])
    estimate.grow(lambda share: watch("mapping", share))
    estimate.finish()
    if not sensors.has_noise:
        estimate.smoother = Smoother(Models(units.noisier(estimate.noise_factor())), support)
        estimate.finish()
    noise = estimate.smoother.models.ranges
    estimate = with_supported_scale(estimate, record.measured, noise)
    gained, by_odometry = (
        gains(solution, record.measured, noise) for solution in (estimate, odometry_path)
    )
    found = agreement(estimate, record, gained)
    uncorrected = agreement(odometry_path, record, by_odometry)
    off_m = np.hypot(*(estimate.x.poses[:, :2] - odometry_path.x.poses[:, :2]).T)
    is_better = predicts_better(gained, by_odometry, record.measured)
    correction = Correction(
        float(off_m.mean()), is_better, expected_error_m(estimate, record.measured)
    )
    verdict = judge(found, correction, axes)
    chosen = estimate if verdict.trusted else odometry_path
    path = poses_of_rows(record, estimate.x.poses[:, :3]) if verdict.trusted else log.odometry
    return LogMap(
        log,
        record.jumps,
        path,
        _floor_plan(log, record, chosen, sensors),
        verdict,
        found,
        uncorrected,
        float(estimate.x.odometry_scale[0]),
        float(estimate.x.gyro_scale[0]),
    )


def odometry_map(log: Log, sensors: SensorsConfig) -> FloorPlan:
    """The map by uncorrected odometry."""
    beams, support = horizontal_beams(log, sensors), _support(log)
    units = RangeUnits({beam: one.unit for beam, one in beams.items()})
    record = to_record(log, beams)
    return _floor_plan(log, record, _held_to_odometry(record, units, support), sensors)


def _held_to_odometry(record: Record, units: RangeUnits, support: Support) -> IncrementalMap:
    smoother = OdometryPath(Models(units), support)
    held = IncrementalMap(smoother, record.measured, record.motion[0])
    held.extend(len(record.rows))
    held.finish()
    return held


def _support(log: Log) -> Support:
    """Support of walls, adapted to the distance between rows."""
    steps = np.hypot(*np.diff(log.odometry[:, :2], axis=0).T)
    moving = steps[steps > MIN_STEP_M]
    wide_m = ROWS_TO_OPEN * float(np.median(moving)) if len(moving) else 0.0
    usual = Support(hits=6, extent_m=0.5, worth=MIN_WORTH)
    return replace(usual, gap_m=max(usual.gap_m, wide_m), opening_m=max(usual.opening_m, wide_m))


def _floor_plan(
    log: Log, record: Record, solution: IncrementalMap, sensors: SensorsConfig
) -> FloorPlan:
    x, m = solution.x, record.measured
    points = project(x, m).points
    sigma_m = solution.smoother.models.ranges.sigma_m(m.beam, m.distance_m)
    height_m, ceiling_m = _heights(log, sensors)
    lines = solution.estimate.wall_lines if solution.estimate else ()
    times_s = log.time_s[record.hit_rows].tolist()
    hits = tuple(
        Hit(time_s, BEAMS[number], (north, east, -height_m), variance)
        for time_s, number, (north, east), variance in zip(
            times_s, m.beam.tolist(), points.tolist(), (sigma_m**2).tolist(), strict=True
        )
    )
    path = tuple(
        Pose(time_s, north, east, -height_m, wrap_rad(yaw))
        for time_s, (north, east, yaw, *_) in zip(
            log.time_s[record.rows].tolist(), x.poses.tolist(), strict=True
        )
    )
    opening_m = max(MIN_OPENING_M, solution.smoother.support.opening_m)
    walls = wall_segments(lines, points, solution.wall_of, opening_m)
    return FloorPlan(walls, hits, path, ceiling_m)


def _heights(log: Log, sensors: SensorsConfig) -> tuple[float, float | None]:
    """Heights of drone and ceiling above the floor; the drone is at zero without a down beam."""
    vertical = {
        beam: usable_ranges(log.ranges_m[beam], sensors.of(beam)) + (sensors.of(beam).offset_m or 0)
        for beam in (Beam.UP, Beam.DOWN)
        if beam in log.ranges_m
    }
    medians = {
        beam: float(np.nanmedian(ranges))
        for beam, ranges in vertical.items()
        if np.isfinite(ranges).any()
    }
    height_m = medians.get(Beam.DOWN, 0.0)
    return height_m, height_m + medians[Beam.UP] if Beam.UP in medians else None
