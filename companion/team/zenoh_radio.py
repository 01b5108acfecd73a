"""Radio between drones over IP networks: Eclipse Zenoh, peer to peer, without a broker.

Each drone publishes at `pdps/TEAM/DRONE`, and receives what all others publish. A packet that
cannot be sent at once is dropped: the next one is newer. With a key each packet ends with 16 bytes
of its HMAC-SHA256, and packets without a valid one are dropped.
"""

import hashlib
import hmac
import json
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager

from companion.config.team import TeamConfig
from companion.core.errors import TeamError
from companion.core.extras import needs_extra
from companion.core.secret import is_loopback, needs_token, read_token
from companion.team.messages import MAX_PACKET_BYTES
from companion.team.radio import NoRadio, TeamRadio

FIRST_PORT = 7447
"""Port of the first drone on this machine: the default of Zenoh."""
MAC_BYTES = 16
"""Length of the message authentication code, bytes. Chosen."""
MAX_WAITING = 4000
"""Most packets that wait to be received; then the oldest are dropped. Chosen: a second of a drone
has forty."""


@contextmanager
def open_team_radio(config: TeamConfig) -> Iterator[TeamRadio]:
    """The radio of a drone; one that sends nothing if it flies alone.

    Raises:
        TeamError: an address is reachable from other machines and there is no key, or is in use.
        SecretError: the key cannot be used.
        MissingExtraError: Zenoh is not installed.
    """
    if not config.name:
        yield NoRadio()
        return
    with needs_extra("team"), closing(ZenohRadio(config)) as radio:
        yield radio


class ZenohRadio:
    """The radio of one drone."""

    def __init__(self, config: TeamConfig) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        addresses = config.addresses or tuple(
            f"127.0.0.1:{FIRST_PORT + number}" for number in range(len(config.pads))
        )
        self._key = _read_key(config, addresses)
        self._waiting: deque[bytes] = deque(maxlen=MAX_WAITING)
        own = addresses[config.drone - 1]
        settings = zenoh.Config()
        for key, value in _settings(own, [each for each in addresses if each != own]).items():
            settings.insert_json5(key, json.dumps(value))
        try:
            self._session = zenoh.open(settings)
        except zenoh.ZError as error:
            raise TeamError(f"team.addresses: {own}: {error}; choose another address") from error
        prefix = f"pdps/{config.name}"
        self._subscriber = self._session.declare_subscriber(
            f"{prefix}/*", self._listener(), allowed_origin=zenoh.Locality.REMOTE
        )
        self._publisher = self._session.declare_publisher(
            f"{prefix}/{config.drone}",
            congestion_control=zenoh.CongestionControl.DROP,
            express=True,
        )

    def _listener(self) -> Callable[[object], None]:
        """Take a sample, in a thread of Zenoh's."""
        waiting = self._waiting

        def take(sample: object) -> None:
            data = bytes(sample.payload)  # type: ignore[attr-defined]
            if len(data) <= MAX_PACKET_BYTES + MAC_BYTES:
                waiting.append(data)

        return take

    def send(self, packets: Sequence[bytes]) -> None:
        for packet in packets:
            self._publisher.put(packet + self._mac(packet))

    def receive(self) -> tuple[bytes, ...]:
        arrived = []
        while self._waiting:
            if (packet := self._checked(self._waiting.popleft())) is not None:
                arrived.append(packet)
        return tuple(arrived)

    def close(self) -> None:
        self._session.close()

    def _mac(self, packet: bytes) -> bytes:
        return hmac.digest(self._key, packet, hashlib.sha256)[:MAC_BYTES] if self._key else b""

    def _checked(self, data: bytes) -> bytes | None:
        """The packet in some bytes; None without a valid code."""
        if not self._key:
            return data
        packet, mac = data[:-MAC_BYTES], data[-MAC_BYTES:]
        return packet if hmac.compare_digest(mac, self._mac(packet)) else None


def _read_key(config: TeamConfig, addresses: Sequence[str]) -> bytes:
    """The key; empty if no other machine can reach the team."""
    if config.key_file is not None:
        return read_token(config.key_file, "team.key_file =").encode()
    for address in addresses:
        if not is_loopback(address.rpartition(":")[0]):
            raise TeamError(needs_token("team.addresses =", repr(address), "team.key_file"))
    return b""


def _settings(own: str, others: Sequence[str]) -> dict[str, object]:
    """Zenoh's configuration: only the given addresses, no discovery, and nothing else served."""
    return {
        "mode": "peer",
        "listen/endpoints": [f"tcp/{own}"],
        "connect/endpoints": [f"tcp/{each}" for each in others],
        "connect/exit_on_failure": False,
        "connect/timeout_ms": -1,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
    }
