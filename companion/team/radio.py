"""Interface of the radio between the drones of a team."""

import secrets
from collections.abc import Sequence
from typing import Protocol


def new_instance() -> int:
    """A number that differs at each start of the program, for `App`."""
    return secrets.randbits(32)


class TeamRadio(Protocol):
    """Sends packets to all teammates in range; some may be lost, late or out of order."""

    def send(self, packets: Sequence[bytes]) -> None: ...

    def receive(self) -> tuple[bytes, ...]:
        """Packets that have arrived since the last call."""
        ...


class NoRadio:
    """The radio of a drone that flies alone."""

    def send(self, packets: Sequence[bytes]) -> None:
        """Send nothing."""

    def receive(self) -> tuple[bytes, ...]:
        return ()
