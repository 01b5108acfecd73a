"""Turns during gyro gaps, recovered from the autopilot's reported heading."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.core.messages import GyroSample, Odometry
from companion.estimation.filters.heading_filter import GyroModel, HeadingFilter
from companion.safety.health.gyro import GyroWatch
from tests.examples import examples

TICK_S, PERIOD_S, FIFO = 0.05, 1 / 119, 32
BEGINS_S = 2.0
RateOf = Callable[[float], float]


@dataclass(frozen=True)
class Turn:
    """A turn whose rate changes once, with a first-order lag."""

    before_rad_s: float
    after_rad_s: float
    changes_s: float
    lag_s: float = 0.15

    def rate_rad_s(self, time_s: float) -> float:
        since_s = max(time_s - self.changes_s, 0.0)
        fade = math.exp(-since_s / self.lag_s)
        return self.after_rad_s + (self.before_rad_s - self.after_rad_s) * fade

    def angle_rad(self, time_s: float) -> float:
        since_s = max(time_s - self.changes_s, 0.0)
        left_rad_s = self.before_rad_s - self.after_rad_s
        caught_up_rad = left_rad_s * self.lag_s * (1 - math.exp(-since_s / self.lag_s))
        before_rad = self.before_rad_s * min(time_s, self.changes_s)
        return before_rad + self.after_rad_s * since_s + caught_up_rad


class Flown:
    """A gyro, an autopilot and a `GyroWatch`."""

    def __init__(self, turn: Turn, phase_s: float, *, bias_rad_s: float = 0.0) -> None:
        self.watch, self._turn, self._bias_rad_s = GyroWatch(), turn, bias_rad_s
        self._phase_s = phase_s
        self._next = 0
        self._last_s: float | None = None
        self.passed_on: list[GyroSample] = []
        self.pulled_rad = 0.0
        self.complaints: set[str] = set()

    def waiting(self, now_s: float) -> list[GyroSample]:
        """The samples since the last call, each with the mean rate of its period."""
        taken = []
        while (time_s := self._phase_s + self._next * PERIOD_S) <= now_s:
            self._next += 1
            turned_rad = self._turn.angle_rad(time_s) - self._turn.angle_rad(time_s - PERIOD_S)
            taken.append(GyroSample(time_s, turned_rad / PERIOD_S + self._bias_rad_s))
        return taken

    def tick(
        self, now_s: float, samples: Sequence[GyroSample], *, has_odometry: bool = True
    ) -> None:
        yaw_rad = math.remainder(self._turn.angle_rad(now_s) + self.pulled_rad, math.tau)
        odometry = Odometry(
            now_s, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), yaw_rad, pulled_rad=self.pulled_rad
        )
        self.passed_on += self.watch.take(
            now_s, samples, odometry if has_odometry else None, self._bias_rad_s
        )
        self.complaints.add(self.watch.complaint)

    def fly(self, from_s: float, until_s: float) -> float:
        now_s = from_s
        while now_s < until_s:
            now_s += TICK_S
            self.tick(now_s, self.waiting(now_s))
        return now_s

    @property
    def error_rad(self) -> float:
        """Error of the turn integrated over all samples that were passed on, rad."""
        first, last = self.passed_on[0].time_s, self.passed_on[-1].time_s
        rates = pairwise(self.passed_on)
        turned_rad = sum(
            (after.yaw_rate_rad_s - self._bias_rad_s) * (after.time_s - before.time_s)
            for before, after in rates
        )
        return turned_rad - (self._turn.angle_rad(last) - self._turn.angle_rad(first))

    @property
    def sigma_rad(self) -> float:
        """Heading sigma due to the gaps, rad, for a gyro with a known scale."""
        heading = HeadingFilter(self._bias_rad_s, GyroModel(scale_sigma=0.0))
        heading.predict(self.passed_on)
        return heading.yaw_sigma_rad


RATES = st.floats(-90, 90).map(math.radians)


@settings(deadline=None, max_examples=examples(200))
@given(
    gap_s=st.floats(0.1, 3.0),
    before_rad_s=RATES,
    after_rad_s=RATES,
    changes=st.floats(0.0, 1.0),
    phase_s=st.floats(0.0, PERIOD_S),
    kept=st.integers(1, FIFO),
    waits=st.integers(0, 3),
    bias_deg_s=st.floats(-2.0, 2.0),
)
def test_the_samples_contain_the_true_turn_in_a_gap(
    *,
    gap_s: float,
    before_rad_s: float,
    after_rad_s: float,
    changes: float,
    phase_s: float,
    kept: int,
    waits: int,
    bias_deg_s: float,
) -> None:
    """After a pause of the process the chip's FIFO contains only the latest samples."""
    turn = Turn(before_rad_s, after_rad_s, BEGINS_S + changes * gap_s)
    missed_s = gap_s - kept * PERIOD_S
    unexpected_rad = (
        turn.angle_rad(BEGINS_S + gap_s)
        - turn.angle_rad(BEGINS_S)
        - 0.5 * (before_rad_s + turn.rate_rad_s(BEGINS_S + gap_s)) * gap_s
    )
    assume(missed_s > 0.02)
    assume(abs(unexpected_rad) < 0.8 * math.pi)  # otherwise the autopilot's heading is ambiguous
    flown = Flown(turn, phase_s, bias_rad_s=math.radians(bias_deg_s))
    now_s = flown.fly(0.0, BEGINS_S)
    now_s += gap_s
    for wait in range(waits + 1):
        flown.tick(now_s, flown.waiting(now_s)[-kept:], has_odometry=wait == waits)
        now_s += TICK_S
    assert abs(flown.error_rad) < math.radians(0.7)
    flown.fly(now_s - TICK_S, now_s + 2.0)
    assert abs(flown.error_rad) < math.radians(0.7)
    assert flown.complaints == {""}


@pytest.mark.parametrize("gap_s", [0.15, 0.3, 0.5, 0.82, 1.5, 3.0])
def test_a_gap_increases_the_heading_sigma(gap_s: float) -> None:
    flown = Flown(Turn(math.radians(45), math.radians(45), 0.0), 0.0)
    now_s = flown.fly(0.0, BEGINS_S)
    before_rad = flown.sigma_rad
    flown.tick(now_s + gap_s, flown.waiting(now_s + gap_s)[-6:])
    grown_rad = math.sqrt(flown.sigma_rad**2 - before_rad**2)
    hidden_rad = math.radians(45) * (gap_s - 6 * PERIOD_S)
    assert grown_rad > 0.025 * hidden_rad
    assert grown_rad < 0.05 * hidden_rad + math.radians(0.6)


def test_a_gap_without_odometry_is_bridged_by_adjacent_rates_with_a_large_sigma() -> None:
    flown = Flown(Turn(math.radians(20), math.radians(20), 0.0), 0.0)
    now_s = flown.fly(0.0, BEGINS_S) + 0.5
    for _ in range(12):
        flown.tick(now_s, flown.waiting(now_s)[-6:], has_odometry=False)
        now_s += TICK_S
    assert abs(flown.error_rad) < math.radians(0.1)
    assert flown.sigma_rad > math.radians(10)


def test_a_gap_in_which_our_clock_stood_still_is_bridged() -> None:
    """The chip ran for another second; its samples are within one tick of our clock."""
    rate_rad_s = math.radians(45)
    flown = Flown(Turn(rate_rad_s, rate_rad_s, 0.0), 0.0)
    now_s = flown.fly(0.0, BEGINS_S) + TICK_S
    crowded = [GyroSample(now_s - 0.0015 * (FIFO - i), rate_rad_s) for i in range(1, FIFO + 1)]
    yaw_rad = math.remainder(rate_rad_s * (now_s + 1.0), math.tau)
    odometry = Odometry(now_s, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), yaw_rad)
    last_s, turned_rad = flown.passed_on[-1].time_s, 0.0
    for sample in flown.watch.take(now_s, crowded, odometry, 0.0):
        turned_rad += sample.yaw_rate_rad_s * (sample.time_s - last_s)
        last_s = sample.time_s
    assert math.degrees(turned_rad) == pytest.approx(45 * 1.05, abs=1.0)


@settings(deadline=None)
@given(st.floats(-20, 20), st.floats(0.05, 4.0), RATES)
def test_a_heading_correction_of_the_autopilot_is_not_a_turn(
    pull_deg: float, lasts_s: float, rate_rad_s: float
) -> None:
    """PX4 shifts its heading by 14° at take-off; ArduPilot steps when it aligns in flight."""
    flown = Flown(Turn(rate_rad_s, rate_rad_s, 0.0), 0.0)
    now_s = flown.fly(0.0, BEGINS_S)
    while now_s < BEGINS_S + lasts_s + 1.0:
        now_s += TICK_S
        share = min((now_s - BEGINS_S) / lasts_s, 1.0)
        flown.pulled_rad = math.radians(pull_deg) * share
        is_gap = BEGINS_S + 0.3 * lasts_s < now_s < BEGINS_S + 0.6 * lasts_s
        samples = flown.waiting(now_s)
        flown.tick(now_s, [] if is_gap else samples)
    assert flown.complaints == {""}
    assert abs(flown.error_rad) < math.radians(0.7)
