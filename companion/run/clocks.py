"""The flight's clock: the machine's, or the virtual one that SITL serves with its bus."""

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
STANDS_STILL_S = 0.25
"""Of real time. SITL waits longer for who has asked for the time: until then it is what it was."""


class Clock(Protocol):
    """Time as the flight knows it: of the machine, or virtual."""

    def wait_until(self, time_s: float) -> float:
        """Return the time once `time_s` is reached; later if the machine was slow."""
        ...

    def now_s(self) -> float:
        """The time by now."""
        ...


class SystemClock:
    """The machine's monotonic clock, counted from `start_s` at the first use."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._epoch_s = time.monotonic() - start_s

    def wait_until(self, time_s: float) -> float:
        time.sleep(max(0.0, time_s - self.now_s()))
        return self.now_s()

    def now_s(self) -> float:
        return time.monotonic() - self._epoch_s

    def close(self) -> None:
        """It goes on by itself."""


class SitlClock:
    """SITL's virtual time, in step with the MAVLink datagrams that belong to each moment.

    Asking for a time lets the simulation reach it. Both sides tell how many datagrams they have
    sent, and wait for them, so that a flight over UDP is the same to the bit as one in process.
    If SITL goes away, time goes on by the machine's clock: the flight must still end by its rules.
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
            self._warn(f"{error}; going on by this machine's clock")
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
        """SITL does not wait for this clock any more."""
        self._served.close()


def open_clock(
    config: Config,
    transport: UdpTransport | SerialTransport,
    warn: Callable[[str], None],
    start_s: float = 0.0,
) -> SystemClock | SitlClock:
    """SITL's where the sensors are SITL's; this machine's goes on from `start_s`.

    Raises:
        ConfigError: its time is kept by datagrams, and there are none.
        SensorError: nothing serves it.
    """
    if not config.sensors.bus.startswith("sitl://"):
        return SystemClock(start_s)
    if not isinstance(transport, UdpTransport):
        raise ConfigError(
            f"link.url = {config.link.url!r}: with sensors at {config.sensors.bus} "
            "it should be udpin:HOST:PORT or udpout:HOST:PORT"
        )
    host, port = config.sensors.bus.removeprefix("sitl://").rsplit(":", 1)
    return SitlClock(VirtualClock(host, int(port)), transport, warn)
