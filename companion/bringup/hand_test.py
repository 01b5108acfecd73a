"""Detects swapped sensors: the user holds a hand before each, and one reading must change."""

import math
from collections.abc import Mapping, Sequence

from rich.console import Console

from companion.bringup.self_test import Examination
from companion.core.messages import Beam, RangeReading
from companion.run.clocks import Clock
from companion.safety.health.lateness import TICK_S

MEASURE_S = 1.5
"""Duration of each measurement, s. Chosen."""
MIN_CHANGE_SIGMAS = 6.0
"""Least change of a reading, in sigmas. Chosen."""
READING_CHANGED_STATE = 1e3
"""Change of the state, in sigmas: larger than any change of a distance."""
Readings = Mapping[Beam, RangeReading]


def changed_beam(before: Sequence[Readings], after: Sequence[Readings]) -> Beam | None:
    """The beam whose reading changed most, in its own sigmas; None if none did."""
    changes = {beam: _change(before, after, beam) for beam in before[0]}
    most = max(changes, key=lambda beam: changes[beam])
    return most if changes[most] > MIN_CHANGE_SIGMAS else None


def _change(before: Sequence[Readings], after: Sequence[Readings], beam: Beam) -> float:
    was, now = _summary(before, beam), _summary(after, beam)
    if was is None or now is None:
        return 0.0 if was is now else READING_CHANGED_STATE
    return abs(now[0] - was[0]) / max(was[1], now[1])


def _summary(readings: Sequence[Readings], beam: Beam) -> tuple[float, float] | None:
    """Mean and sigma; None if most readings are not distances."""
    distances = [r[beam] for r in readings if r[beam].is_distance]
    if len(distances) < len(readings) / 2:
        return None
    mean_m = sum(r.distance_m for r in distances) / len(distances)
    return mean_m, math.sqrt(sum(r.variance_m2 for r in distances)) / len(distances)


def verdict(expected: Beam, changed: Beam | None) -> str:
    """Verdict as text; empty if the sensor is correct."""
    if changed is expected:
        return ""
    if changed is None:
        return f"{expected.value}: no reading changed; check the sensor's direction and its plug"
    return (
        f"{expected.value} and {changed.value} are swapped, or {expected.value} is wired as "
        f"{changed.value}: exchange them in [sensors]"
    )


def ask_for_hands(examination: Examination, clock: Clock, console: Console) -> bool:
    """Ask for a hand before each sensor in turn; True if any is swapped."""
    complaints = []
    for beam in list(examination.readings):
        console.input(f"take your hands away from all sensors, then press Enter ({beam.value})")
        before = _measure(examination, clock)
        console.input(f"hold a hand a forearm's length before {beam.value}, then press Enter")
        complaint = verdict(beam, changed_beam(before, _measure(examination, clock)))
        complaints += [complaint] if complaint else []
        console.print(complaint or f"{beam.value}: good")
    return bool(complaints)


def _measure(examination: Examination, clock: Clock) -> list[Readings]:
    now_s = clock.wait_until(0.0)
    end_s = now_s + MEASURE_S
    readings: list[Readings] = []
    while now_s < end_s:
        now_s = clock.wait_until(now_s + TICK_S)
        examination.step(now_s)
        readings.append(dict(examination.readings))
    return readings
