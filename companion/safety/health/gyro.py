"""Whether the gyro can be believed, and what turned the drone while it was silent.

                 gap           now
    gyro      ●●●●     ●●●●●●●●│
    autopilot ●  ●  ●  ●  ●  ● ●   turned in the gap = by it in all - by the gyro's other samples

The autopilot tells its turn once a tick, and after a pause of ours only once for all of it. How far
it was ahead of the gyro before the gap, and how far it is ahead after it, is what the gap hides,
wherever in between the samples come again.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise

from companion.core.frames import wrap_rad
from companion.core.messages import GyroSample, Odometry

MAX_RATE_RAD_S = math.radians(240)
"""Nearly what the LSM9DS1 can tell: it may be more."""
GAP_S, GAP_PERIODS = 0.06, 3.0
"""Between two samples that is a gap: the slowest gyro gives three in that time, if it can."""
CROWDED_SHARE, CROWDED_OF = 0.5, 8
"""So many samples that lie so much closer than usual: our clock stood still meanwhile."""
USUAL_GAIN = 0.05
TOLD_S = 0.15
"""While it is told as often as that, the autopilot's turn in between is known."""
KEPT = 12
"""So many turns that were told, half a second of them."""
FRESH_S = 0.25
"""A gyro that has been silent for longer is not compared."""
WAIT_S = 0.5
"""So long samples wait for the autopilot to tell of the gap before them."""
BRIDGED_RAD, BRIDGED_GAP_S, BRIDGED_SHARE = math.radians(0.5), 0.25, 0.03
"""Sigma of a turn that was bridged, less in a shorter gap: it is told late in a turn that begins or
ends; and both gyros have a scale."""
UNSEEN_RAD_S = math.radians(30)
"""Sigma of a turn of which nobody tells, per second."""
MEMORY_S = 5.0
"""The two turns are compared over this time, the older the less."""
APART_RAD, APART_SHARE = math.radians(4.0), 0.08
"""So far apart they may be: biases, and scales by how much was turned."""
APART_FOR_S = 0.5
"""And for so long: while the autopilot's clock is set, its turn is told by a wrong time."""
STEP_RAD = math.radians(5.0)
"""An autopilot that aligns its heading anew turns it by more in one tick."""


class GyroWatch:
    """Compares how far gyro and autopilot have turned."""

    def __init__(self) -> None:
        self.came = False
        """Samples came with the latest `take`."""
        self.turned_rad = 0.0
        """In all, by the gyro without its bias."""
        self._last: GyroSample | None = None
        self._waiting: list[GyroSample] = []
        self._waits_since_s = math.inf
        self._usual_s = math.nan
        """Between two samples."""
        self._odometries: deque[Odometry] = deque(maxlen=KEPT)
        self._compared: tuple[Odometry, float] | None = None
        """When both were last heard, and how far the autopilot had turned more than the gyro."""
        self._goes_on = False
        """No gap has been since."""
        self._apart_rad = self._turning_rad = 0.0
        self._apart_s: float | None = None
        """Since when they have been too far apart,"""
        self._apart_for_s = 0.0
        """and for how long that is."""
        self._is_saturated = False

    @property
    def complaint(self) -> str:
        """Why it cannot be believed; or nothing."""
        if self._is_saturated:
            return "the gyro is saturated"
        if self._apart_for_s >= APART_FOR_S:
            return "gyro and autopilot do not turn alike"
        return ""

    @property
    def odometry_until_s(self) -> float:
        """The time of the latest sample that was handed on."""
        return -math.inf if self._last is None else self._last.time_s

    def take(
        self,
        now_s: float,
        samples: Sequence[GyroSample],
        odometry: Odometry | None,
        bias_rad_s: float | None,
    ) -> Sequence[GyroSample]:
        """The samples; the first after a silence carries the turn that the autopilot saw in it.

        They wait until it has told how it turned. Before the bias is known, nothing is compared.
        """
        samples = [sample for sample in samples if math.isfinite(sample.yaw_rate_rad_s)]
        self.came = bool(samples)
        if samples:
            self._is_saturated = any(abs(s.yaw_rate_rad_s) > MAX_RATE_RAD_S for s in samples)
        if odometry is not None:
            self._odometries.append(odometry)
        taken = self._without_gap(now_s, [*self._waiting, *samples], odometry, bias_rad_s or 0.0)
        self._integrate(taken, bias_rad_s or 0.0)
        if odometry is not None:
            self._compare(odometry, bias_rad_s or 0.0)
        if bias_rad_s is None:
            self._apart_rad = self._turning_rad = 0.0
        self._judge(now_s)
        return taken

    def _without_gap(
        self,
        now_s: float,
        samples: list[GyroSample],
        odometry: Odometry | None,
        bias_rad_s: float,
    ) -> list[GyroSample]:
        self._waiting = []
        at = self._gap(samples)
        if at is None:
            return samples
        if odometry is None and now_s - min(self._waits_since_s, now_s) < WAIT_S:
            self._waits_since_s = min(self._waits_since_s, now_s)
            self._waiting = samples
            return []
        self._waits_since_s = math.inf
        self._apart_rad, self._goes_on = 0.0, False
        samples[at] = self._bridging(samples, at, odometry, bias_rad_s)
        return samples

    def _gap(self, samples: Sequence[GyroSample]) -> int | None:
        """The sample before which the longest gap is, if there is one."""
        if not samples or self._last is None:
            return None
        steps_s = _steps_s(self._last, samples)
        mean_s = sum(steps_s) / len(steps_s)
        if len(samples) >= CROWDED_OF and mean_s < CROWDED_SHARE * self._usual_s:
            return 0
        at = max(range(len(steps_s)), key=steps_s.__getitem__)
        if math.isnan(self._usual_s):
            self._usual_s = min(steps_s)
        if steps_s[at] > max(GAP_S, GAP_PERIODS * self._usual_s):
            return at
        self._usual_s += USUAL_GAIN * (mean_s - self._usual_s)
        return None

    def _bridging(
        self,
        samples: Sequence[GyroSample],
        at: int,
        odometry: Odometry | None,
        bias_rad_s: float,
    ) -> GyroSample:
        """The sample after the gap, with the rate and the variance of the whole turn in it."""
        assert self._last is not None
        steps_s = _steps_s(self._last, samples)
        before = samples[at - 1] if at else self._last
        gap_s = max(steps_s[at], 1e-3)
        rate_rad_s = 0.5 * (before.yaw_rate_rad_s + samples[at].yaw_rate_rad_s)
        if odometry is None or self._compared is None:
            sigma_rad = UNSEEN_RAD_S * gap_s
        else:
            others_rad = sum(
                (sample.yaw_rate_rad_s - bias_rad_s) * step_s
                for i, (sample, step_s) in enumerate(zip(samples, steps_s, strict=True))
                if i != at
            )
            turned_rad = self.turned_rad + others_rad
            ahead_rad = self._ahead_of(odometry, samples[-1], turned_rad, bias_rad_s)
            expected_rad = (rate_rad_s - bias_rad_s) * gap_s
            unexpected_rad = wrap_rad(ahead_rad - self._compared[1] - expected_rad)
            turn_rad = expected_rad + unexpected_rad
            rate_rad_s = turn_rad / gap_s + bias_rad_s
            share = min(gap_s / BRIDGED_GAP_S, 1.0)
            sigma_rad = math.hypot(share * BRIDGED_RAD, BRIDGED_SHARE * turn_rad)
        return GyroSample(samples[at].time_s, rate_rad_s, sigma_rad**2)

    def _ahead_of(
        self, odometry: Odometry, last: GyroSample, turned_rad: float, bias_rad_s: float
    ) -> float:
        """How far the autopilot has turned more than the gyro, which had by its last sample."""
        autopilot_rad = self._autopilot_yaw_at(last.time_s)
        if autopilot_rad is None:
            late_s = odometry.time_s - last.time_s
            autopilot_rad = odometry.turned_rad - (last.yaw_rate_rad_s - bias_rad_s) * late_s
        return autopilot_rad - turned_rad

    def _autopilot_yaw_at(self, time_s: float) -> float | None:
        """How far the autopilot had turned by then; None if it did not tell before and after."""
        for before, after in pairwise(self._odometries):
            if before.time_s < time_s <= after.time_s <= before.time_s + TOLD_S:
                share = (time_s - before.time_s) / (after.time_s - before.time_s)
                turn_rad = wrap_rad(after.turned_rad - before.turned_rad)
                return before.turned_rad + share * turn_rad
        return None

    def _integrate(self, samples: Sequence[GyroSample], bias_rad_s: float) -> None:
        for sample in samples:
            if self._last is not None:
                dt_s = sample.time_s - self._last.time_s
                self.turned_rad += (sample.yaw_rate_rad_s - bias_rad_s) * dt_s
            self._last = sample

    def _compare(self, odometry: Odometry, bias_rad_s: float) -> None:
        """Once for each odometry, while the gyro speaks."""
        if self._last is None or abs(odometry.time_s - self._last.time_s) > FRESH_S:
            return
        ahead_rad = self._ahead_of(odometry, self._last, self.turned_rad, bias_rad_s)
        before, self._compared = self._compared, (odometry, ahead_rad)
        goes_on, self._goes_on = self._goes_on, True
        if before is None or not goes_on:
            return
        dt_s = odometry.time_s - before[0].time_s
        behind_rad = wrap_rad(before[1] - ahead_rad)
        if dt_s > MEMORY_S or abs(behind_rad) > STEP_RAD * max(dt_s / 0.05, 1.0):
            return
        fade = math.exp(-dt_s / MEMORY_S)
        turn_rad = wrap_rad(odometry.turned_rad - before[0].turned_rad)
        self._apart_rad = fade * self._apart_rad + behind_rad
        self._turning_rad = fade * self._turning_rad + abs(turn_rad)

    def _judge(self, now_s: float) -> None:
        if abs(self._apart_rad) <= APART_RAD + APART_SHARE * self._turning_rad:
            self._apart_s = None
        elif self._apart_s is None:
            self._apart_s = now_s
        self._apart_for_s = 0.0 if self._apart_s is None else now_s - self._apart_s


def _steps_s(last: GyroSample, samples: Sequence[GyroSample]) -> list[float]:
    """From each sample to the one before it."""
    times_s = [last.time_s, *(sample.time_s for sample in samples)]
    return [after - before for before, after in pairwise(times_s)]
