"""Nothing that comes in may break the simulator; `python -m benchmarks.fuzz_sitl` asks for more."""

from random import Random

import pytest

from benchmarks.fuzz_sitl import fuzz_autopilot, fuzz_bus
from companion.link.transport import decode, make_codec
from sitl.testing.fuzz import OTHER_SYSTEM, foreign_frame


@pytest.mark.parametrize("personality", ["ardupilot", "px4"])
def test_odd_mavlink_frames_are_survived(personality: str) -> None:
    fuzz_autopilot(personality, 3000, seed=1)


def test_odd_bus_requests_are_survived() -> None:
    fuzz_bus(3000, seed=1)


def test_foreign_frames_hold_nothing_for_this_vehicle() -> None:
    random, codec = Random(1), make_codec(1, 1)
    frames = (foreign_frame(random) for _ in range(2000))
    told = [m for frame in frames for m in decode(codec, frame)]
    assert len(told) > 300
    assert {m.target_system for m in told} == {OTHER_SYSTEM}
