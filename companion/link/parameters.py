"""The autopilot's parameters that matter to us, read until it has told them."""

from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import Message


class ReadParameters:
    """By name; those that are not known yet are missing from `values`."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()
        self.values: dict[str, float] = {}

    def want(self, names: Iterable[str]) -> None:
        self._names = tuple(names)

    def hear(self, name: str, value: float) -> None:
        """Also when somebody else has asked for it, or set it."""
        if name in self._names:
            self.values[name] = value

    def requests(self, target: tuple[int, int]) -> list[Message]:
        """PARAM_REQUEST_READ (20) of what is missing."""
        return [
            mavlink.MAVLink_param_request_read_message(*target, name.encode(), -1)
            for name in self._names
            if name not in self.values
        ]

    def forget(self) -> None:
        """The autopilot has rebooted: it may hold others."""
        self.values.clear()
