"""Runs a few inputs of each fuzz target; `python -m benchmarks.robustness.fuzz` runs more."""

from random import Random

import pytest

from benchmarks.robustness.fuzz import TARGETS, fuzz
from companion.link.transports.transport import decode, make_codec
from sitl.testing.fuzz import OTHER_SYSTEM, foreign_frame

INPUTS = {
    **{"ardupilot": 3000, "px4": 3000, "companion": 3000},
    **{"bus": 3000, "replies": 2000, "serial": 5000},
}
OF_A_FILE = 300


@pytest.mark.parametrize("target", TARGETS)
def test_every_target_handles_odd_input(target: str) -> None:
    fuzz(target, INPUTS.get(target, OF_A_FILE), seed=1)


def test_foreign_frames_never_address_this_vehicle() -> None:
    random, codec = Random(1), make_codec(1, 1)
    frames = (foreign_frame(random) for _ in range(2000))
    decoded = [m for frame in frames for m in decode(codec, frame)]
    assert len(decoded) > 300
    assert {m.target_system for m in decoded} == {OTHER_SYSTEM}
