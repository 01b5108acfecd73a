"""Checks the gyro against the autopilot's turn, and bridges gaps between its samples.

                 gap           now
    gyro      ●●●●     ●●●●●●●●│
    autopilot ●  ●  ●  ●  ●  ● ●   turn in the gap = autopilot's turn - turn of other gyro samples

The autopilot reports its turn once per tick, and only once after a pause of the companion. The
autopilot's turn minus the gyro's is computed before and after the gap. The increase is the turn in
the gap. This holds wherever the samples resume.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise

from companion.core.frames import wrap_rad
from companion.core.messages import GyroSample, Odometry

MAX_RATE_RAD_S = math.radians(240)
"""Yaw rate that counts as saturated, rad/s; nearly the full scale of the LSM9DS1."""
GAP_S, GAP_PERIODS = 0.06, 3.0
"""Minimum gap between two samples, s and in usual periods; the longer one counts. Chosen: the
slowest gyro gives three samples in 0.06 s."""
CROWDED_SHARE, CROWDED_OF = 0.5, 8
"""If at least so many samples (second) lie closer than this share (first) of the usual period, the
companion's clock stood still before them. Chosen."""
USUAL_GAIN = 0.05
"""Filter gain of the usual period. Chosen."""
TOLD_S = 0.15
"""Maximum interval between two autopilot headings for interpolation, s. Chosen."""
KEPT = 12
"""Number of stored odometry messages: half a second."""
FRESH_S = 0.25
"""Maximum age of the last gyro sample for a comparison, s. Chosen."""
WAIT_S = 0.5
"""Time for which samples after a gap wait for the autopilot's turn, s. Chosen."""
BRIDGED_RAD, BRIDGED_GAP_S, BRIDGED_SHARE = math.radians(0.5), 0.25, 0.03
"""Sigma of a bridged turn: the first, rad, in gaps from the second, s, on, less in shorter gaps,
plus a share of the turn. Chosen: the reported turn is late where a turn begins or ends, and both
gyros have a scale factor error."""
UNSEEN_RAD_S = math.radians(30)
"""Sigma of a turn in a gap without a report of the autopilot, rad per second of gap. Chosen."""
MEMORY_S = 5.0
"""Time constant of the comparison of the two turns, s. Chosen."""
APART_RAD, APART_SHARE = math.radians(4.0), 0.08
"""Maximum difference of the two turns: a constant for biases, rad, plus a share of the turn for
scale factor errors. Chosen."""
APART_FOR_S = 0.5
"""Time for which the difference must last, s. Chosen: while the autopilot sets its clock, its turn
has a wrong time."""
STEP_RAD = math.radians(5.0)
"""A larger change in one tick is a realignment of the autopilot's heading, rad. Chosen."""


class GyroWatch:
    """Compares the turns of gyro and autopilot, and bridges gaps of the gyro."""

    def __init__(self) -> None:
        self.came = False
        """The latest `take` contained samples."""
        self.turned_rad = 0.0
        """Total turn by the gyro without its bias, rad."""
        self._last: GyroSample | None = None
        self._waiting: list[GyroSample] = []
        self._waits_since_s = math.inf
        self._usual_s = math.nan
        """Usual period between two samples, s."""
        self._odometries: deque[Odometry] = deque(maxlen=KEPT)
        self._compared: tuple[Odometry, float] | None = None
        """Odometry of the last comparison, and the autopilot's turn minus the gyro's, rad."""
        self._goes_on = False
        """True if there was no gap since then."""
        self._apart_rad = self._turning_rad = 0.0
        self._apart_s: float | None = None
        """Time since which the difference is too large, s; None if it is not."""
        self._apart_for_s = 0.0
        """Duration of that, s."""
        self._is_saturated = False

    @property
    def complaint(self) -> str:
        """Reason why the gyro is invalid; empty if it is valid."""
        if self._is_saturated:
            return "the gyro is saturated"
        if self._apart_for_s >= APART_FOR_S:
            return "gyro and autopilot do not turn alike"
        return ""

    @property
    def odometry_until_s(self) -> float:
        """Time of the latest sample that `take` returned, s."""
        return -math.inf if self._last is None else self._last.time_s

    def take(
        self,
        now_s: float,
        samples: Sequence[GyroSample],
        odometry: Odometry | None,
        bias_rad_s: float | None,
    ) -> Sequence[GyroSample]:
        """Return the samples; the first one after a gap contains the autopilot's turn in the gap.

        Samples after a gap wait until the autopilot has reported its turn. Before the bias is
        known, nothing is compared.
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
        """Index of the sample after the longest gap; None if there is no gap."""
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
        """The sample after the gap, with the mean rate and the variance of the turn in the gap."""
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
        """Autopilot's turn minus the gyro's at the time of the gyro's last sample, rad."""
        autopilot_rad = self._autopilot_yaw_at(last.time_s)
        if autopilot_rad is None:
            late_s = odometry.time_s - last.time_s
            autopilot_rad = odometry.turned_rad - (last.yaw_rate_rad_s - bias_rad_s) * late_s
        return autopilot_rad - turned_rad

    def _autopilot_yaw_at(self, time_s: float) -> float | None:
        """Interpolated turn of the autopilot, rad; None without reports before and after."""
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
        """Update the comparison with an odometry message, if the gyro's samples are fresh."""
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
    """Intervals between each sample and the one before it, s."""
    times_s = [last.time_s, *(sample.time_s for sample in samples)]
    return [after - before for before, after in pairwise(times_s)]
