"""Tests the direction of level beams by the walls that they detect while the drone flies."""

import math
from random import Random

import pytest

from companion.core.messages import Beam, RangeReading, RangeState
from companion.safety.health.beam_line import BeamLine, Stand

TICK_S, SPEED_M_S = 0.05, 0.55
AHEAD_M, RIGHT_M = 4.5, 3.0
"""Walls ahead and to the right of the start; the drone flies to 1 m before the one ahead."""
SIGMA_M = 0.05
"""Noise of the paper's sensor, 1 sigma."""
ODOMETRY_SIGMA_M_S = 0.1
"""Noise of the odometry's velocity before it is smoothed over ten ticks, m/s. Chosen."""


def found_off_after_m(beam: Beam, wired_as: Beam, drift_deg: float, seed: int) -> float | None:
    """Way after which `beam`, wired to the sensor of another one, is found; None if it is not.

    The drone drifts to the right of its heading.
    """
    random, line = Random(seed), BeamLine(beam)
    aside = math.tan(math.radians(drift_deg))
    ahead_m = right_m = 0.0
    error_m_s = 0.0
    stand = Stand()
    for tick in range(round((AHEAD_M - 1) / SPEED_M_S / TICK_S)):
        ahead_m, right_m = ahead_m + SPEED_M_S * TICK_S, right_m + aside * SPEED_M_S * TICK_S
        error_m_s += 0.1 * (random.gauss(0, ODOMETRY_SIGMA_M_S) - error_m_s)
        stand = Stand(
            stand.ahead_m + SPEED_M_S * TICK_S,
            stand.right_m + (aside * SPEED_M_S + error_m_s) * TICK_S,
        )
        true_m = {Beam.FRONT: AHEAD_M - ahead_m, Beam.RIGHT: RIGHT_M - right_m}[wired_as]
        measured_m = random.gauss(true_m, SIGMA_M)
        reading = RangeReading(RangeState.DISTANCE, measured_m, SIGMA_M**2)
        line.take(tick * TICK_S, reading, stand)
        if line.is_off(tick * TICK_S):
            return ahead_m
    return None


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("drift_deg", [-15.0, -8.0, 0.0, 8.0, 15.0])
@pytest.mark.parametrize("beam", [Beam.FRONT, Beam.RIGHT])
def test_a_beam_in_its_own_direction_is_accepted(beam: Beam, drift_deg: float, seed: int) -> None:
    assert found_off_after_m(beam, beam, drift_deg, seed) is None


@pytest.mark.parametrize("seed", range(5))
def test_a_right_beam_wired_as_the_front_one_is_found_before_the_wall(seed: int) -> None:
    """The front beam stays constant while the drone flies ahead."""
    way_m = found_off_after_m(Beam.FRONT, Beam.RIGHT, 0.0, seed)
    assert way_m is not None
    assert way_m < 3.0
