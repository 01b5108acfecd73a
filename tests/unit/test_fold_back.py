"""The Sharp's alias is told by the way to it; one test for each arrow of the diagram."""

import pytest

from companion.drivers.fold_back import FoldBack
from companion.drivers.sharp import GP2Y0A710K0F
from companion.messages import Beam, Odometry, RangeReading, RangeScan, RangeState

STEP_S = 0.05


class Approach:
    """A drone that moves towards and away from a wall ahead, with a Sharp looking at it."""

    def __init__(self, distance_m: float, beam: Beam = Beam.FRONT) -> None:
        self.fold_back = FoldBack([beam])
        self.beam = beam
        self.distance_m = self.start_m = distance_m
        self.yaw_rad = 0.0
        self.time_s = 0.0

    def to(self, distance_m: float, speed_m_s: float = 0.5) -> list[RangeReading]:
        """What is told on the way."""
        told = []
        while abs(distance_m - self.distance_m) > 1e-9:
            step_m = min(speed_m_s * STEP_S, abs(distance_m - self.distance_m))
            self.distance_m += step_m if distance_m > self.distance_m else -step_m
            told.append(self.look())
        return told

    def look(self, reading: RangeReading | None = None) -> RangeReading:
        self.time_s += STEP_S
        forward_m = self.start_m - self.distance_m
        odometry = Odometry(self.time_s, (forward_m, 0.0, 0.0), (0.0, 0.0, 0.0), self.yaw_rad)
        raw = reading or GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(self.distance_m))
        scan = RangeScan(self.time_s, {self.beam: raw})
        return self.fold_back.checked(scan, odometry).readings[self.beam]


def distances(readings: list[RangeReading]) -> list[float]:
    return [reading.distance_m for reading in readings if reading.is_distance]


@pytest.mark.parametrize("speed_m_s", [0.05, 0.3, 1.0])
def test_a_wall_that_is_flown_at_stays_too_near(speed_m_s: float) -> None:
    drone = Approach(2.0)
    drone.to(1.05, speed_m_s)
    told = drone.to(0.12, speed_m_s)
    assert not [d for d in distances(told) if d > 1.1]
    assert told[-1].state is RangeState.TOO_NEAR


@pytest.mark.parametrize("nearest_m", [0.9, 0.6, 0.3, 0.15])
def test_on_the_way_back_it_is_believed_again_from_one_metre_on(nearest_m: float) -> None:
    drone = Approach(2.0)
    drone.to(nearest_m)
    told = drone.to(2.0)
    assert all(0.99 < d <= 2.01 for d in distances(told))
    assert told[-1].distance_m == pytest.approx(2.0)


def test_a_turn_shows_another_thing_which_is_believed() -> None:
    drone = Approach(2.0)
    drone.to(0.3)
    far = RangeReading(RangeState.DISTANCE, 3.0, 0.01)
    assert drone.look(far).state is RangeState.TOO_NEAR
    drone.yaw_rad = 0.4
    assert drone.look(far).distance_m == 3.0


def test_even_nothing_in_range_is_too_near_when_it_stands_at_the_wall() -> None:
    drone = Approach(2.0)
    drone.to(0.3)
    assert drone.look(RangeReading(RangeState.NOTHING)).state is RangeState.TOO_NEAR


def test_silence_stays_silence() -> None:
    drone = Approach(2.0)
    drone.to(0.3)
    assert drone.look(RangeReading(RangeState.FAILED)).state is RangeState.FAILED


def test_sensors_that_do_not_fold_are_left_alone() -> None:
    fold_back = FoldBack([])
    scan = RangeScan(0.0, {Beam.FRONT: RangeReading(RangeState.TOO_NEAR)})
    assert fold_back.checked(scan, None) is scan


def test_moving_sideways_and_up_does_not_count_ahead() -> None:
    drone = Approach(2.0)
    drone.to(0.8)
    aside = Odometry(drone.time_s + 0.05, (1.2, 5.0, -3.0), (0.0, 0.0, 0.0), 0.0)
    far = RangeReading(RangeState.DISTANCE, 1.2, 0.01)
    scan = RangeScan(aside.time_s, {Beam.FRONT: far})
    assert drone.fold_back.checked(scan, aside).readings[Beam.FRONT] == far
