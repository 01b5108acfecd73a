"""Simulates the radio between the drones of a team: loss, delay and range, per pair of drones."""

from collections.abc import Callable, Sequence

from sitl.core.noise import stream
from sitl.core.radio import LinkErrors, Radio

USUAL_ERRORS = LinkErrors(loss=0.02, jitter_s=0.05)
"""Errors of a wireless network indoors. Chosen: one packet in fifty is lost."""

Reach = Callable[[int, int], bool]
"""True if a packet of the first drone reaches the second, by their numbers from 0."""


def reaches_all(sender: int, receiver: int) -> bool:
    """No drone is out of range."""
    return True


class TeamAir:
    """The radios of all drones, on one clock."""

    def __init__(
        self,
        seed: int,
        drones: int,
        now_s: Callable[[], float],
        errors: LinkErrors = USUAL_ERRORS,
    ) -> None:
        self.reach: Reach = reaches_all
        """Which drones hear which; for tests and faults."""
        self._now_s = now_s
        self._ways: dict[tuple[int, int], Radio[bytes]] = {}
        for sender in range(drones):
            for receiver in range(drones):
                if sender != receiver:
                    radio: Radio[bytes] = Radio(stream(seed, f"team {sender} to {receiver}"))
                    radio.errors = errors
                    self._ways[sender, receiver] = radio
        self.radios = tuple(SimulatedTeamRadio(self, number) for number in range(drones))
        self.sent_bytes = [0] * drones

    def send(self, sender: int, packets: Sequence[bytes]) -> None:
        """Send packets to all drones in range."""
        self.sent_bytes[sender] += sum(map(len, packets))
        for (by, receiver), radio in self._ways.items():
            if by == sender and self.reach(sender, receiver):
                radio.launch(packets, self._now_s())

    def receive(self, receiver: int) -> tuple[bytes, ...]:
        """Packets that have arrived at a drone."""
        now_s = self._now_s()
        return tuple(
            packet
            for (_, by), radio in self._ways.items()
            if by == receiver
            for packet in radio.arrived(now_s)
        )


class SimulatedTeamRadio:
    """The radio of one drone."""

    def __init__(self, air: TeamAir, number: int) -> None:
        self._air, self._number = air, number

    def send(self, packets: Sequence[bytes]) -> None:
        if packets:
            self._air.send(self._number, packets)

    def receive(self) -> tuple[bytes, ...]:
        return self._air.receive(self._number)
