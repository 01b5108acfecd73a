"""Provides the flight's clock: the machine's, or SITL's virtual clock."""

import math
import time
from collections.abc import Callable
from typing import Protocol

from companion.config.settings import Config
from companion.core.errors import ConfigError, SensorError
from companion.drivers.wires.served_bus import VirtualClock
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import UdpTransport

DATAGRAM_TIMEOUT_S = 1.0
"""Maximum wait for the MAVLink datagrams of a tick, s. Chosen."""
STANDS_STILL_S = 0.25
"""Real time after a tick during which the virtual time does not change, s.

Chosen: SITL waits longer than this for a client that has requested a time.
"""


class Clock(Protocol):
    """Interface of the flight's clock, real or virtual."""

    def wait_until(self, time_s: float) -> float:
        """Wait until `time_s` and return the time, which is later if the machine was slow."""
        ...

    def now_s(self) -> float:
        """Current time, s."""
        ...

    def close(self) -> None:
        """End the use of this clock; may be called again."""
        ...


class SystemClock:
    """The machine's monotonic clock; it starts at `start_s` when this object is created."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._epoch_s = time.monotonic() - start_s

    def wait_until(self, time_s: float) -> float:
        time.sleep(max(0.0, time_s - self.now_s()))
        return self.now_s()

    def now_s(self) -> float:
        return time.monotonic() - self._epoch_s

    def close(self) -> None:
        """No resource to release."""


class SitlClock:
    """SITL's virtual clock, in lockstep with the MAVLink datagrams of each tick.

    A request for a time advances the simulation to it. Both sides report how many datagrams they
    have sent, and wait for those of the other. A flight over UDP is therefore bit-identical to one
    in a single process. If the connection to SITL is lost, the machine's clock takes over, so that
    the flight still ends by its rules.
    """

    def __init__(
        self, served: VirtualClock, transport: UdpTransport, warn: Callable[[str], None]
    ) -> None:
        self._served = served
        self._transport = transport
        self._warn = warn
        self._last_s = 0.0
        self._tick_real_s = -math.inf
        self._fallback: SystemClock | None = None

    def wait_until(self, time_s: float) -> float:
        if self._fallback is not None:
            return self._fallback.wait_until(time_s)
        transport = self._transport
        try:
            self._last_s, sent = self._served.advance_to(
                time_s, transport.local_port, transport.datagrams_sent
            )
        except SensorError as error:
            self._warn(f"{error}; continuing with this machine's clock")
            self._fallback = SystemClock(self._last_s)
            return self._last_s
        transport.await_datagrams(sent, DATAGRAM_TIMEOUT_S)
        self._tick_real_s = time.monotonic()
        return self._last_s

    def now_s(self) -> float:
        if self._fallback is not None:
            return self._fallback.now_s()
        if time.monotonic() - self._tick_real_s < STANDS_STILL_S:
            return self._last_s
        return self.wait_until(self._last_s)

    def close(self) -> None:
        """Disconnect; SITL no longer waits for this clock."""
        self._served.close()


def open_clock(
    config: Config,
    transport: UdpTransport | SerialTransport,
    warn: Callable[[str], None],
    start_s: float = 0.0,
) -> SystemClock | SitlClock:
    """Open SITL's clock if `sensors.bus` is SITL's, else this machine's, starting at `start_s`.

    Raises:
        ConfigError: SITL's clock needs a UDP link, and `link.url` is not one.
        SensorError: no SITL answers at the address of the bus.
    """
    if not config.sensors.is_simulated:
        return SystemClock(start_s)
    if not isinstance(transport, UdpTransport):
        raise ConfigError(
            f"link.url = {config.link.url!r}: with sensors at {config.sensors.bus} "
            "it should be udpin:HOST:PORT or udpout:HOST:PORT"
        )
    host, port = config.sensors.bus.removeprefix("sitl://").rsplit(":", 1)
    return SitlClock(VirtualClock(host, int(port)), transport, warn)
