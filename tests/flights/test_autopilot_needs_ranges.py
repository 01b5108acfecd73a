"""Tests an autopilot that waits for the companion's ranges before it arms."""

import pytest

from sitl.testing import Sitl

NEEDS_RANGES = {"PRX1_TYPE": 2, "RNGFND1_TYPE": 10, "RNGFND1_ORIENT": 25}


@pytest.mark.parametrize("kind", ["distance_sensor", "obstacle_distance"])
def test_the_autopilot_flies_if_it_receives_the_companions_ranges(
    sitl: Sitl, small: str, kind: str
) -> None:
    settings = {"link.tell_ranges": kind}
    flight = sitl.fly(small, settings=settings, parameters=NEEDS_RANGES, profile="tfmini_s")
    assert flight.completed, flight.ending


def test_the_autopilot_does_not_arm_without_ranges_and_reports_why(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", parameters=NEEDS_RANGES, profile="tfmini_s")
    assert "No Data" in flight.ending
