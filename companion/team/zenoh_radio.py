"""Radio between drones over IP networks: Eclipse Zenoh, peer to peer, without a broker.

Each drone publishes at `pdps/TEAM/DRONE`, and receives what all others publish. A packet that
cannot be sent at once is dropped: the next one is newer. The drones know each other's addresses, or
find each other on one network interface by multicast. With a key each packet ends with 16 bytes
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
LOOPBACK = "lo"
"""Interface that no other machine can reach."""
MAC_BYTES = 16
"""Length of the message authentication code, bytes. Chosen."""
MAX_WAITING = 4000
"""Most packets that wait to be received; then the oldest are dropped. Chosen: a second of a drone
has forty."""


@contextmanager
def open_team_radio(config: TeamConfig) -> Iterator[TeamRadio]:
    """The radio of a drone; one that sends nothing if it flies alone.

    Raises:
        TeamError: other machines can reach an address or interface, and there is no key; an address
            is in use; there is no such interface.
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

        self._key = _read_key(config)
        self._waiting: deque[bytes] = deque(maxlen=MAX_WAITING)
        settings = zenoh.Config()
        for key, value in _settings(config).items():
            settings.insert_json5(key, json.dumps(value))
        try:
            self._session = zenoh.open(settings)
        except zenoh.ZError as error:
            key, value = _place(config)
            raise TeamError(f"team.{key}: {value}: {error}; choose another one") from error
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


def _addresses(config: TeamConfig) -> tuple[str, ...]:
    """Address of each drone, `HOST:PORT`; on this machine by default."""
    on_this_machine = (f"127.0.0.1:{FIRST_PORT + number}" for number in range(len(config.pads)))
    return config.addresses or tuple(on_this_machine)


def _place(config: TeamConfig) -> tuple[str, str]:
    """Key and value of the configuration that say where this drone listens."""
    if config.interface:
        return "interface", config.interface
    return "addresses", _addresses(config)[config.drone - 1]


def _read_key(config: TeamConfig) -> bytes:
    """The key; empty if no other machine can reach the team."""
    if config.key_file is not None:
        return read_token(config.key_file, "team.key_file =").encode()
    key, own = _place(config)
    for place in [own] if config.interface else _addresses(config):
        if place != LOOPBACK and not is_loopback(place.rpartition(":")[0]):
            private = LOOPBACK if config.interface else "127.0.0.1"
            raise TeamError(needs_token(f"team.{key} =", repr(place), "team.key_file", private))
    return b""


def _settings(config: TeamConfig) -> dict[str, object]:
    """Zenoh's configuration: peers of the team alone, and nothing else served."""
    settings: dict[str, object] = {
        "mode": "peer",
        "connect/exit_on_failure": False,
        "connect/timeout_ms": -1,
        "scouting/multicast/enabled": bool(config.interface),
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
    }
    if config.interface:
        return settings | {
            "listen/endpoints": [f"tcp/0.0.0.0:0#iface={config.interface}"],
            "scouting/multicast/interface": config.interface,
        }
    addresses = _addresses(config)
    own = addresses[config.drone - 1]
    return settings | {
        "listen/endpoints": [f"tcp/{own}"],
        "connect/endpoints": [f"tcp/{each}" for each in addresses if each != own],
    }
