"""The coupling watch distinguishes an open ADC input from a sensor."""

import numpy as np
import pytest

from companion.core.arrays import Array
from companion.core.messages import Beam, RangeReading, RangeScan, RangeState
from companion.safety.health.coupling import CouplingWatch

FIVE = (Beam.FRONT, Beam.LEFT, Beam.RIGHT, Beam.UP, Beam.DOWN)
NOISE_V = 0.010


def flown(seed: int, ticks: int = 200, noise_v: float = NOISE_V) -> Array:
    """Voltages of five sensors whose distances to walls vary smoothly, with a few edges."""
    rng = np.random.default_rng(seed)
    at_s = 0.05 * np.arange(ticks)[:, None]
    phases, rates = rng.uniform(0, 6, 5), rng.uniform(0.1, 0.6, 5)
    edges = np.cumsum(rng.choice([0.0, 0.3, -0.3], (ticks, 5), p=[0.98, 0.01, 0.01]), axis=0)
    volts = 1.9 + 0.4 * np.sin(phases + rates * at_s) + np.clip(edges, -0.3, 0.3)
    table: Array = volts + rng.normal(0, noise_v, volts.shape)
    return table


def found_open(volts: Array) -> set[Beam]:
    watch, found = CouplingWatch(), set[Beam]()
    for i, row in enumerate(volts.tolist()):
        readings = {
            beam: RangeReading(RangeState.DISTANCE, 2.0, 0.01, v)
            for beam, v in zip(FIVE, row, strict=True)
        }
        watch.take(RangeScan(0.05 * i, readings))
        found |= watch.open
    return found


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("noise_v", [0.010, 0.001])
def test_powered_sensors_are_not_reported_as_open(seed: int, noise_v: float) -> None:
    assert found_open(flown(seed, noise_v=noise_v)) == set()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("memory", [0.8, 0.93])
@pytest.mark.parametrize(("open_", "after"), [(1, 0), (2, 1), (0, 4), (3, 4)])
def test_an_input_that_repeats_the_previous_conversion_is_open(
    seed: int, memory: float, open_: int, after: int
) -> None:
    """An open first input repeats the last channel of the previous sweep."""
    volts = flown(seed)
    shown = np.roll(volts[:, after], 1 if after > open_ else 0)
    noise = np.random.default_rng(seed + 100).normal(0, 0.003, len(volts))
    volts[:, open_] = 0.45 + memory * (shown - 0.45) + noise
    assert found_open(volts) == {FIVE[open_]}


@pytest.mark.parametrize("seed", range(10))
def test_supply_ripple_on_all_sensors_is_no_open_input(seed: int) -> None:
    volts = flown(seed)
    ripple = np.random.default_rng(seed + 200).normal(0, 0.010, len(volts))
    assert found_open(volts + ripple[:, None]) == set()


def test_sensors_without_a_voltage_are_not_compared() -> None:
    watch = CouplingWatch()
    silent = dict.fromkeys(FIVE, RangeReading(RangeState.STALE))
    for i in range(100):
        watch.take(RangeScan(0.05 * i, silent))
    assert watch.open == frozenset()
