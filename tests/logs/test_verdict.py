"""The map of a log is used if it predicts held-out ranges, otherwise the odometry."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.mapping.logs import outcome, row
from benchmarks.mapping.offline_logs import L_SHAPE, Flight, Log, Noise, Scenario, record
from companion.core.arrays import Array
from companion.core.messages import Beam
from companion.offline.held_out import predicts_better
from companion.offline.mapper import LogMap, map_log
from companion.offline.path_error import apart_m
from companion.offline.reading.log import Log as ReadLog
from companion.offline.reading.log import Reading
from companion.offline.reading.sensors import SensorsConfig
from companion.offline.record import to_record
from companion.offline.verdict import Correction, judge
from sitl.world.format import Segment

LOGS = Path(__file__).parents[3] / "shared" / "logs"
has_logs = pytest.mark.skipif(not LOGS.exists(), reason="no ../shared/logs beside the checkout")


def ring(north_m: float, east_m: float, inset_m: float) -> list[Segment]:
    low, north, east = inset_m, north_m - inset_m, east_m - inset_m
    corners = [(low, low), (north, low), (north, east), (low, east)]
    return list(zip(corners, [*corners[1:], corners[0]], strict=True))


def corridor(*, ends: bool) -> list[Segment]:
    sides: list[Segment] = [((0, 0), (40, 0)), ((0, 2.2), (40, 2.2))]
    return sides + ([((0, 0), (0, 2.2)), ((40, 0), (40, 2.2))] if ends else [])


ROUND = Scenario(
    [*ring(16, 11, 0), *ring(16, 11, 2)],
    Flight([(1, 1), *[(15, 1), (15, 10), (1, 10), (1, 1)] * 2], rate_hz=2),
)
L_ROOM = Scenario(
    L_SHAPE,
    Flight([(1.5, 1.5), (8.5, 1.5), (8.5, 3.5), (3.5, 3.5), (3.5, 8.5), (1.5, 1.5)], rate_hz=4),
)
TO_AND_FRO = Flight(
    [(10, 1.1), *[(30, 1.1), (10, 1.1)] * 2], 0.4, turn_rate_rad_s=math.radians(20), rate_hz=1
)


def read_of(log: Log) -> ReadLog:
    ranges = {beam: ranges.copy() for beam, ranges in log.ranges_m.items()}
    return ReadLog.of(log.time_s, log.odometry.copy(), ranges, None, Reading())


def mapped(log: Log) -> LogMap:
    return map_log(read_of(log), SensorsConfig(), lambda activity, share: None)


def error_m(path: Array, log: Log) -> float:
    """Root mean square error in the frame of the first pose, m."""
    return float(np.sqrt(((path[:, :2] - log.truth[:, :2]) ** 2).sum(axis=1).mean()))


def with_motion(log: Log, scale: float, turned_rad: Array) -> Log:
    """Odometry with this scale error and these additional turns in each step."""
    yaw = np.diff(log.truth[:, 2])
    heading = log.truth[0, 2] + np.concatenate([[0.0], np.cumsum(yaw + turned_rad)])
    off_rad = heading - log.truth[:, 2]
    moved = scale * np.diff(log.truth[:, :2], axis=0) @ [1, 1j] * np.exp(1j * off_rad[:-1])
    place = np.concatenate([[0], np.cumsum(moved)])
    return replace(log, odometry=np.column_stack([place.real, place.imag, heading]))


def with_wheel_odometry(
    log: Log, deg_per_sqrt_m: float, seed: int, *, deg_per_m: float = 0.0
) -> Log:
    """Odometry with a random walk of the heading over the distance, and a drift to one side."""
    way_m = np.hypot(*np.diff(log.truth[:, :2], axis=0).T)
    noise = np.random.default_rng(seed).normal(0, 1, len(way_m))
    off_deg = deg_per_sqrt_m * np.sqrt(way_m) * noise + deg_per_m * way_m
    return with_motion(log, 1.02, np.radians(off_deg))


def shuffled(log: Log) -> Log:
    order = np.random.default_rng(1).permutation(len(log.time_s))
    return replace(log, ranges_m={beam: ranges[order] for beam, ranges in log.ranges_m.items()})


def late(log: Log) -> Log:
    """Ranges delayed by about 4 s."""
    rows = math.ceil(4 / float(np.diff(log.time_s).mean()))
    ranges_m = {beam: np.roll(ranges, rows) for beam, ranges in log.ranges_m.items()}
    return replace(log, ranges_m=ranges_m)


def on_the_side(log: Log) -> Log:
    """Sensors turned by 90 degrees, axes of the drone unchanged."""
    turned = {Beam.RIGHT: Beam.FRONT, Beam.BACK: Beam.RIGHT, Beam.LEFT: Beam.BACK}
    source = turned | {Beam.FRONT: Beam.LEFT}
    return replace(log, ranges_m={beam: log.ranges_m[source[beam]] for beam in source})


@pytest.mark.parametrize("spoilt", [shuffled, late, on_the_side])
@pytest.mark.parametrize("scenario", [ROUND, L_ROOM])
def test_ranges_that_do_not_match_leave_the_odometry_unchanged(
    scenario: Scenario, spoilt: Callable[[Log], Log]
) -> None:
    """In a corridor most of these ranges are on walls by chance."""
    log = spoilt(record(scenario, 1))
    result = mapped(log)
    assert result.verdict.word == "doubtful"
    np.testing.assert_array_equal(result.path, log.odometry)


def test_the_same_ranges_without_modification_are_trusted() -> None:
    for scenario in (ROUND, L_ROOM):
        log = record(scenario, 1)
        result = mapped(log)
        assert result.verdict.trusted, result.verdict.reason
        assert error_m(result.path, log) < 0.15


def test_a_log_with_a_quarter_of_outliers_is_trusted() -> None:
    log = record(replace(ROUND, noise=Noise(outliers=0.25, dropouts=0.1)), 2)
    result = mapped(log)
    assert result.verdict.trusted, result.verdict.reason
    assert error_m(result.path, log) < 0.15


@pytest.mark.parametrize("seed", [1, 2])
def test_heading_errors_do_not_shrink_a_corridor(seed: int) -> None:
    """Such errors would shrink it by a tenth or more: a shorter path crosses the walls less."""
    scenario = Scenario(corridor(ends=False), TO_AND_FRO, Noise(range_sigma_m=0.03))
    log = with_wheel_odometry(record(scenario, seed), 1.2, seed, deg_per_m=1.0)
    result = mapped(log)
    assert result.verdict.trusted, result.verdict.reason
    assert abs(result.odometry_scale_error) < 0.02
    assert error_m(result.path, log) < 0.4 < error_m(log.odometry, log) / 8


@pytest.mark.parametrize("scale", [0.8, 1.25])
def test_walls_correct_a_large_odometry_scale_error(scale: float) -> None:
    log = record(L_ROOM, 3)
    log = with_motion(log, scale, np.zeros(len(log.time_s) - 1))
    result = mapped(log)
    assert result.verdict.trusted, result.verdict.reason
    assert result.odometry_scale_error == pytest.approx(1 / scale - 1, abs=0.03)
    assert error_m(result.path, log) < 0.15


def yaw_counter_clockwise(log: Log) -> Log:
    return replace(log, odometry=log.odometry * (1, 1, -1))


def y_to_the_left(log: Log) -> Log:
    return replace(log, odometry=log.odometry * (1, -1, -1))


def x_to_the_east(log: Log) -> Log:
    return replace(log, odometry=log.odometry[:, [1, 0, 2]])


def left_is_right(log: Log) -> Log:
    left, right = log.ranges_m[Beam.LEFT], log.ranges_m[Beam.RIGHT]
    return replace(log, ranges_m={**log.ranges_m, Beam.LEFT: right, Beam.RIGHT: left})


@pytest.mark.parametrize(
    ("confused", "remedy"),
    [
        (yaw_counter_clockwise, "with odom_yaw_rad and the gyro negated"),
        (y_to_the_left, "or odom_y_m, odom_yaw_rad and the gyro negated"),
        (x_to_the_east, "with odom_x_m and odom_y_m exchanged"),
        (left_is_right, "with left_m and right_m exchanged"),
    ],
)
def test_a_log_with_other_axes_names_the_likelier_ones(
    confused: Callable[[Log], Log], remedy: str
) -> None:
    log = confused(with_wheel_odometry(record(L_ROOM, 1), 0.5, 1))
    result = mapped(log)
    assert not result.verdict.trusted
    assert remedy in result.verdict.reason
    np.testing.assert_array_equal(result.path, log.odometry)


def test_ranges_without_a_place_name_no_other_axes() -> None:
    assert "axes" not in mapped(shuffled(record(L_ROOM, 1))).verdict.reason


@pytest.mark.parametrize(
    ("correction", "wall_sigma_m", "trusted"),
    [
        (Correction(mean_m=2.0, is_better=0.99, expected_error_m=0.2), 0.1, True),
        (Correction(mean_m=2.0, is_better=0.8, expected_error_m=0.2), 0.1, False),
        (Correction(mean_m=0.1, is_better=0.5, expected_error_m=0.2), 0.1, True),
        (Correction(mean_m=2.0, is_better=0.99, expected_error_m=0.2), 0.4, False),
        (Correction(mean_m=2.0, is_better=0.99, expected_error_m=1.3), 0.1, False),
    ],
)
def test_a_map_far_from_the_odometry_needs_evidence_and_exact_walls(
    correction: Correction, wall_sigma_m: float, *, trusted: bool
) -> None:
    """Maps of real logs whose odometry was good were 1 to 3 m off, and trusted."""
    found = replace(mapped(record(L_ROOM, 3)).agreement, wall_sigma_m=wall_sigma_m)
    verdict = judge(found, correction)
    assert verdict.trusted == trusted
    assert verdict.better_than_odometry == correction.is_better
    is_told = "the path is only known to" in verdict.reason
    assert is_told == (correction.expected_error_m > 1)


HALL_BETWEEN = Scenario(
    [((0, 0), (12, 0)), ((0, 2.2), (12, 2.2)), ((40, 20), (40, 32)), ((37.8, 20), (37.8, 32))],
    Flight([(1, 1.1), (11, 1.1), (1, 1.1), (38.9, 1.1), (38.9, 31), (38.9, 21)], rate_hz=2),
)
"""Two corridors at a right angle, and 45 m without walls between them."""


@pytest.mark.parametrize(("deg_per_m", "trusted"), [(0.02, True), (3.0, False)])
def test_a_path_between_walls_is_known_as_well_as_its_odometry(
    deg_per_m: float, *, trusted: bool
) -> None:
    """Both corridors fit their ranges; how they lie to each other, only the wheels say."""
    log = with_wheel_odometry(record(HALL_BETWEEN, 1), deg_per_m, 1, deg_per_m=deg_per_m)
    verdict = mapped(log).verdict
    assert verdict.trusted == trusted, verdict.reason
    assert (verdict.expected_error_m < 1.0) == trusted


@given(
    seed=st.integers(0, 1000),
    turned_rad=st.floats(-math.pi, math.pi),
    moved_m=st.floats(-100, 100),
)
def test_moved_and_turned_paths_are_not_apart(seed: int, turned_rad: float, moved_m: float) -> None:
    path = np.random.default_rng(seed).normal(0, 3, (20, 2)).cumsum(axis=0)
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)
    moved = path @ np.array([[cos, sin], [-sin, cos]]) + moved_m
    assert apart_m(path, moved) == pytest.approx(0, abs=1e-6)
    bent = np.where(np.arange(20)[:, None] < 10, path, path + np.array([0, 2]))
    assert 0 < apart_m(path, bent) <= 1


def test_equal_predictions_prove_nothing_and_better_ones_much() -> None:
    m = to_record(read_of(record(L_ROOM, 3)), {}).measured
    m = replace(m, frame=np.arange(0, len(m.dt_s), 2))
    some = np.random.default_rng(1).normal(0.5, 0.3, len(m.frame))
    assert predicts_better(some, some, m) == 0.5
    assert predicts_better(some, np.zeros(len(some)), m) > 0.99
    assert predicts_better(np.zeros(len(some)), some, m) < 0.01


def test_a_log_with_exact_odometry_is_trusted() -> None:
    log = record(L_ROOM, 4)
    result = mapped(replace(log, odometry=log.truth.copy()))
    assert result.verdict.trusted, result.verdict.reason
    assert error_m(result.path, log) < 0.05


def test_sparse_ranges_of_a_wheeled_robot_leave_the_odometry_unchanged() -> None:
    """Rows 3 s and 45 degrees apart, heading errors of 15 degrees in 5 m, and outliers."""
    flight = Flight([(2, 1.1), *[(38, 1.1), (2, 1.1)]], speed_m_s=0.35, rate_hz=0.35)
    scenario = Scenario(
        corridor(ends=True), flight, Noise(outliers=0.4, dropouts=0.3), (Beam.FRONT, Beam.LEFT)
    )
    log = with_wheel_odometry(record(scenario, 1), 7.0, 1)
    result = mapped(log)
    assert result.verdict.word == "doubtful"
    np.testing.assert_array_equal(result.path, log.odometry)


@has_logs
@pytest.mark.parametrize(("name", "most_m"), [("aces_200", 0.2), ("fr101", 0.25)])
def test_logs_of_real_robots_are_mapped(name: str, most_m: float) -> None:
    """Rows 2 to 5 s and up to 1 m apart; many ranges are not on straight walls."""
    found = outcome(LOGS / f"{name}.csv")
    assert found.result.verdict.trusted, found.result.verdict.reason
    assert found.ate_m is not None
    assert found.ate_m < most_m


@has_logs
@pytest.mark.parametrize(
    ("name", "words"),
    [("time_in_ms", "if these are milliseconds"), ("clock_set_back", "the clock was set")],
)
def test_logs_with_a_wrong_clock_are_refused(name: str, words: str) -> None:
    assert words in row(LOGS / f"{name}.csv")
