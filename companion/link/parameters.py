"""Reads the autopilot parameters that the companion needs, with retries until each is received."""

from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import Message


def read_requests(target: tuple[int, int], names: Iterable[str]) -> list[Message]:
    """PARAM_REQUEST_READ (20) for each parameter, to a system and component."""
    return [
        mavlink.MAVLink_param_request_read_message(*target, name.encode(), -1) for name in names
    ]


class ReadParameters:
    """Parameter values by name; `values` contains only the parameters received so far."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()
        self.values: dict[str, float] = {}

    def want(self, names: Iterable[str]) -> None:
        self._names = tuple(names)

    def receive(self, name: str, value: float) -> None:
        """Store a received value, also one that another client requested or set."""
        if name in self._names:
            self.values[name] = value

    def requests(self, target: tuple[int, int]) -> list[Message]:
        """PARAM_REQUEST_READ (20) for each missing parameter."""
        return read_requests(target, (name for name in self._names if name not in self.values))

    def forget(self) -> None:
        """Discard all values: after a reboot the autopilot may have different ones."""
        self.values.clear()
