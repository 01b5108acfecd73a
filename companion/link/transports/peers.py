"""Selects the peer of a UDP link among all senders.

A link has one peer: the configured address, or the first that sends a MAVLink message. Otherwise
any program that knows the port could control the vehicle. Another sender becomes the peer only
after the peer was silent for `TAKEOVER_S` while others sent. A restarted companion, or an
application on a new port, is therefore accepted at its third heartbeat. An earlier peer that sends
again replaces a later one at once: a computer that was overloaded for two seconds does not lose its
link to a stranger. This prevents accidents, not attacks: an attacker can forge the address.
"""

from collections.abc import Sequence
from dataclasses import dataclass

TAKEOVER_S = 1.5
"""Silence of the peer before another sender replaces it, s.

Chosen: more than the 1 s between two heartbeats of a peer that sends nothing else.
"""
Address = tuple[str, int]
"""Host and port."""


@dataclass(slots=True)
class Peer:
    """The other end of a link, with the number of datagrams to and from it."""

    address: Address | None
    """None before the first message of a peer that is not configured."""
    datagrams_sent: int = 0
    datagrams_received: int = 0
    is_miscounted: bool = False
    """Some were lost, so that the number of received ones says nothing until it is set anew."""


class Peers:
    """The peer, and those that it replaced; time is an argument."""

    def __init__(self, address: Address | None) -> None:
        self._peers = [Peer(address)]
        """In the order in which they became the peer; the last one is the peer."""
        self._others_since_s: float | None = None
        """Time since which only other senders were received, not the peer; else None."""

    @property
    def peer(self) -> Peer:
        return self._peers[-1]

    def hear(self, senders: Sequence[Address], now_s: float) -> None:
        """Select the peer again, after messages from these senders have been received."""
        if not senders:
            return
        for number, peer in enumerate(self._peers):
            if peer.address in senders:
                del self._peers[number + 1 :]
                self._others_since_s = None
                return
        if self.peer.address:
            if self._others_since_s is None:
                self._others_since_s = now_s
            if now_s - self._others_since_s < TAKEOVER_S:
                return
        self._peers.append(Peer(senders[0]))
        self._others_since_s = None
