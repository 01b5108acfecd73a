"""Relays what two drones tell each other over Zenoh, and loses a part of it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from random import Random

from companion.config.team import TeamConfig
from companion.team.radio import TeamRadio
from companion.team.zenoh_radio import open_team_radio
from tests.processes.started import free_tcp_port
from tests.waiting import DEADLINE_S

PERIOD_S = 0.002
"""Interval at which the relay looks for packets, s."""


@dataclass
class LossyRadio:
    """A radio between two drones. Each is connected with the relay, in place of its teammate."""

    teams: tuple[TeamConfig, TeamConfig]
    """Configuration of each drone."""
    carried: int = 0
    lost: int = 0
    """Packets so far."""

    @property
    def loss(self) -> float:
        return self.lost / max(self.carried + self.lost, 1)


@contextmanager
def lossy_radio(team: TeamConfig, loss: float) -> Iterator[LossyRadio]:
    """The radio of a team of two. `loss`: the share of packets that do not arrive."""
    ends = tuple(
        team.model_copy(
            update={
                "drone": drone,
                "addresses": tuple(f"127.0.0.1:{free_tcp_port()}" for _ in team.pads),
            }
        )
        for drone in (1, 2)
    )
    radio = LossyRadio((ends[0], ends[1]))
    instead_of_second, instead_of_first = (
        each.model_copy(update={"drone": other}) for each, other in zip(ends, (2, 1), strict=True)
    )
    is_over = threading.Event()
    random = Random(1)

    def carry(heard: TeamRadio, to: TeamRadio) -> None:
        for packet in heard.receive():
            if random.random() < loss:
                radio.lost += 1
            else:
                radio.carried += 1
                to.send([packet])

    def relay(with_first: TeamRadio, with_second: TeamRadio) -> None:
        while not is_over.wait(PERIOD_S):
            carry(with_first, with_second)
            carry(with_second, with_first)

    with (
        open_team_radio(instead_of_second) as with_first,
        open_team_radio(instead_of_first) as with_second,
    ):
        thread = threading.Thread(target=relay, args=(with_first, with_second))
        thread.start()
        try:
            yield radio
        finally:
            is_over.set()
            thread.join(DEADLINE_S)
