"""Tests SIGKILL in flight once.

`python -m benchmarks.robustness.kill_recording` does it 50 times.
"""

from pathlib import Path

import pytest

from benchmarks.robustness.kill_recording import kill_a_flight

SPEED = 4.0


@pytest.mark.parametrize("after_s", [1.0, 6.0])
def test_a_killed_companion_loses_at_most_one_second(tmp_path: Path, after_s: float) -> None:
    killed = kill_a_flight(tmp_path, after_s, SPEED)
    assert killed.at_s > 1.0
    assert killed.lost_s <= 1.0
    assert killed.messages > 0
    assert killed.packets > 0
