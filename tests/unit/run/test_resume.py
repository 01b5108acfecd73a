"""`companion recover` before the mode of the drone is known."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.link.link import Link
from companion.link.transports.transport import Message, pipe_pair
from companion.run.resume import hold

GUIDED, LOITER, LAND = 4, 5, 9
REQUESTS = (511, 512)
"""Commands that request messages and have no effect on the flight."""


def beat(mode: int, *, armed: bool = True) -> Message:
    return mavlink.MAVLink_heartbeat_message(2, 3, 209 if armed else 81, mode, 4, 3)


class Vehicle:
    """Sends the messages of the test at their times; also the `Clock` of the companion."""

    def __init__(self, messages: dict[float, Message]) -> None:
        self._end, companions = pipe_pair()
        self.link = Link(companions, LinkConfig())
        self._messages = dict(sorted(messages.items()))
        self.received: list[Any] = []

    def wait_until(self, time_s: float) -> float:
        for when_s in [when_s for when_s in self._messages if when_s <= time_s]:
            self._end.send(self._messages.pop(when_s))
        self.received += self._end.receive()
        return time_s

    def now_s(self) -> float:
        return 0.0

    def close(self) -> None:
        """No resource to release."""

    def received_of(self, kind: str) -> list[Any]:
        return [m for m in self.received if m.get_type() == kind]


def busy(seconds: float) -> Iterator[None]:
    """Work that takes this time, in ticks of 0.05 s."""
    for _ in range(round(seconds / 0.05)):
        yield


@pytest.mark.parametrize("work", [lambda: iter(()), lambda: busy(3.0)])
def test_a_drone_in_our_mode_is_held(work: Callable[[], Iterator[None]]) -> None:
    vehicle = Vehicle({float(second): beat(GUIDED) for second in range(8)})
    assert hold(vehicle.link, vehicle, work())


@pytest.mark.parametrize(
    "other", [beat(LOITER), beat(LAND), beat(LOITER, armed=False), beat(GUIDED, armed=False)]
)
def test_a_mode_change_or_disarming_releases_the_drone_at_once(other: Message) -> None:
    vehicle = Vehicle({0.0: beat(GUIDED), 1.0: beat(GUIDED), 1.4: other})
    assert not hold(vehicle.link, vehicle, busy(3.0))
    setpoints = vehicle.received_of("SET_POSITION_TARGET_LOCAL_NED")
    assert setpoints[-1].time_boot_ms < 1450
    assert not [m for m in vehicle.received_of("COMMAND_LONG") if m.command not in REQUESTS]


def test_a_brief_mode_change_releases_the_drone() -> None:
    vehicle = Vehicle({0.0: beat(GUIDED), 1.40: beat(LOITER), 1.401: beat(GUIDED)})
    assert not hold(vehicle.link, vehicle, busy(3.0))


def test_hold_waits_for_the_next_heartbeat_after_the_work() -> None:
    vehicle = Vehicle({0.0: beat(GUIDED), 1.0: beat(LOITER)})
    assert not hold(vehicle.link, vehicle, busy(0.5))
