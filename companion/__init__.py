"""Software of the companion computer: sensors in, a floor plan and velocity setpoints out.

Scripts use `from companion import connect`; see docs/scripts.md.
"""

import os
from typing import TYPE_CHECKING, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Set before numpy is imported. The matrices are small, so extra threads only wait for each other.
Beside other work they cost up to five times the processor time."""

if TYPE_CHECKING:
    from companion.core.errors import CompanionError, FlightEndedError, NotCompletedError
    from companion.core.messages import (
        Beam,
        FloorPlan,
        Pose,
        RangeReading,
        RangeScan,
        RangeState,
        WallSegment,
    )
    from companion.run.script import Drone, connect
    from companion.run.script_async import AsyncDrone, connect_async
    from companion.run.telemetry import Subscription, Subscriptions
    from companion.team.teammate import Heard

_PLACES = {
    "CompanionError": "core.errors",
    "FlightEndedError": "core.errors",
    "NotCompletedError": "core.errors",
    "Beam": "core.messages",
    "FloorPlan": "core.messages",
    "Pose": "core.messages",
    "RangeReading": "core.messages",
    "RangeScan": "core.messages",
    "RangeState": "core.messages",
    "WallSegment": "core.messages",
    "Heard": "team.teammate",
    "Drone": "run.script",
    "connect": "run.script",
    "AsyncDrone": "run.script_async",
    "connect_async": "run.script_async",
    "Subscription": "run.telemetry",
    "Subscriptions": "run.telemetry",
}

__all__ = [
    "AsyncDrone",
    "Beam",
    "CompanionError",
    "Drone",
    "FlightEndedError",
    "FloorPlan",
    "Heard",
    "NotCompletedError",
    "Pose",
    "RangeReading",
    "RangeScan",
    "RangeState",
    "Subscription",
    "Subscriptions",
    "WallSegment",
    "connect",
    "connect_async",
]


def __getattr__(name: str) -> Any:
    """Import a public name on first use, because most modules do not need it."""
    if name not in _PLACES:
        raise AttributeError(f"module 'companion' has no attribute {name!r}")
    from importlib import import_module  # noqa: PLC0415

    return getattr(import_module(f"companion.{_PLACES[name]}"), name)
