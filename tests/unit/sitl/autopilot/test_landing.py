"""Tests that landings drift as far as those of the real firmware."""

import math

import pytest

from tests.unit.sitl.autopilot.client import ACCEPTED, ORIGIN, Client

LANDINGS = 20


def drift_m(firmware: str, seed: int) -> float:
    """Horizontal drift from 1 m above the ground to the ground, m."""
    client = Client(firmware, seed)
    client.waits(5)
    client.sends(ORIGIN)
    if firmware == "ardupilot":
        client.is_ready()
    assert client.result(400, 1) == ACCEPTED
    target = [0.0] * 6 + [2.0] if firmware == "ardupilot" else [math.nan] * 7
    assert client.result(22, *target) == ACCEPTED
    client.waits(12)
    truth = client.autopilot.truth
    assert truth.position_ned_m[2] < -1.5
    assert client.result(21) == ACCEPTED
    while client.autopilot.truth.position_ned_m[2] < -1.0:
        client.waits(0.05)
    high_ne_m = client.autopilot.truth.position_ned_m[:2]
    client.waits(5)
    touched = client.autopilot.truth.position_ned_m
    assert touched[2] == pytest.approx(0.0, abs=0.01)
    client.waits(4)
    assert client.autopilot.truth.position_ned_m[:2] == touched[:2], "it slides on the ground"
    return math.dist(high_ne_m, touched[:2])


@pytest.mark.parametrize(("firmware", "measured_m"), [("px4", 0.27), ("ardupilot", 0.10)])
def test_the_landing_drift_matches_the_real_firmware(firmware: str, measured_m: float) -> None:
    """Compares the RMS drift of 20 landings with that of the real firmware."""
    squares = [drift_m(firmware, seed) ** 2 for seed in range(1, LANDINGS + 1)]
    assert math.sqrt(sum(squares) / LANDINGS) == pytest.approx(measured_m, rel=0.35)
