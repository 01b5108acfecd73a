"""The fence of PX4 beside the limits of the mission; ArduPilot's is in `test_self_test.py`."""

import pytest

from companion.bringup.fences import fence_beside
from companion.bringup.findings import CheckResult
from companion.config.settings import MissionConfig
from companion.link.firmware import FENCE_OUTSIDE_M, ArduPilot, Fence, Firmware, Px4

LIMITED = MissionConfig(max_height_m=2.5, max_distance_m=8.0)


@pytest.mark.parametrize(
    ("action", "height_m", "distance_m", "good", "words"),
    [
        (5, 3.5, 9.0, True, "max_height_m 3.5 m, max_distance_m 9 m"),
        (2, 3.5, 0.0, True, "max_distance_m inf m"),
        (5, 0.0, 0.0, True, "off"),
        (5, 2.0, 9.0, False, "stops at 2 m, and mission.max_height_m = 2.5"),
        (3, 3.5, 9.0, False, "GF_ACTION 3 returns, and climbs"),
        (4, 3.5, 9.0, False, "stops the motors"),
    ],
)
def test_the_fence_of_px4(
    action: int, height_m: float, distance_m: float, good: bool, words: str
) -> None:
    values = {"GF_ACTION": action, "GF_MAX_VER_DIST": height_m, "GF_MAX_HOR_DIST": distance_m}
    found = fence_beside(Px4(), values, LIMITED)
    assert found is not None
    assert (found.verdict is CheckResult.GOOD) == good
    assert words in found.seen
    assert fence_beside(Px4(), values, MissionConfig()) is None


@pytest.mark.parametrize("firmware", [ArduPilot(), Px4()])
def test_the_fence_that_is_written_fits(firmware: Firmware) -> None:
    limits = Fence(LIMITED.max_height_m, LIMITED.max_distance_m)
    values = {p.name: p.wire_value for p in firmware.fence_parameters(limits)}
    found = fence_beside(firmware, {**values, "GF_ACTION": 5}, LIMITED)
    assert found is not None
    assert found.verdict is CheckResult.GOOD
    assert str(2.5 if isinstance(firmware, ArduPilot) else 2.5 + FENCE_OUTSIDE_M) in found.seen
