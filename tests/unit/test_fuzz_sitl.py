"""Nothing that comes in may break the simulator; `python -m benchmarks.fuzz_sitl` asks for more."""

import pytest

from benchmarks.fuzz_sitl import fuzz_autopilot, fuzz_bus


@pytest.mark.parametrize("personality", ["ardupilot", "px4"])
def test_odd_mavlink_frames_are_survived(personality: str) -> None:
    fuzz_autopilot(personality, 3000, seed=1)


def test_odd_bus_requests_are_survived() -> None:
    fuzz_bus(3000, seed=1)
