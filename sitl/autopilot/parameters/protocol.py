"""The common part of the autopilots' parameter protocols.

PARAM_SET ──► set ──► values ──► PARAM_VALUE
PARAM_REQUEST_READ ──► read ──┘
PARAM_REQUEST_LIST ──► begin_list ──► due, a few at every step
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.parameters.table import Parameter, Table
from sitl.autopilot.streams import Message

NO_INDEX = 65535
"""param_index of a response that is not part of a list: -1, unsigned."""

ParameterWatch = Callable[[str, float], None]
"""Called with the name and value of every parameter that is set."""


class Parameters(ABC):
    """Values by name; encoding and validation differ between the autopilots."""

    listed_per_step: ClassVar[int]
    """Parameters of a list that are sent every 10 ms."""

    def __init__(self, table: Table, values: dict[str, float], watch: ParameterWatch) -> None:
        self.values = values
        self._table = table
        self._watch = watch
        self._index = {name: index for index, name in enumerate(table)}
        self._to_list: deque[str] = deque()

    def set(self, message: Message) -> list[Message]:
        """PARAM_SET (23). A rejected value has no response."""
        parameter = self._table.get(message.param_id)
        value = self._taken(parameter, message) if parameter else None
        if parameter is None or value is None:
            return []
        self.values[parameter.name] = value
        self._watch(parameter.name, value)
        return [self._answer(parameter.name)]

    def read(self, message: Message) -> list[Message]:
        """PARAM_REQUEST_READ (20) by index or, if that is -1, by name; no response if unknown."""
        names = list(self._table)
        if 0 <= message.param_index < len(names):
            return [self._value_message(names[message.param_index], message.param_index)]
        if message.param_index == -1 and message.param_id in self._table:
            return [self._answer(message.param_id)]
        return []

    def begin_list(self) -> None:
        """PARAM_REQUEST_LIST (21): start from the beginning, also during a list."""
        self._to_list = deque(self._table)

    @property
    def is_listing(self) -> bool:
        return bool(self._to_list)

    def due(self) -> list[Message]:
        """This step's part of the list."""
        count = min(self.listed_per_step, len(self._to_list))
        names = [self._to_list.popleft() for _ in range(count)]
        return [self._value_message(name, self._index.get(name, NO_INDEX)) for name in names]

    def _value_message(self, name: str, index: int) -> Message:
        """PARAM_VALUE (22)."""
        kind = self._table[name].kind
        wire = self._wire(self.values[name], kind)
        return mavlink.MAVLink_param_value_message(
            name.encode(), wire, kind, len(self._table), index
        )

    @abstractmethod
    def _taken(self, parameter: Parameter, message: Message) -> float | None:
        """The new value after PARAM_SET; None if rejected."""

    @abstractmethod
    def _wire(self, value: float, kind: int) -> float:
        """The value as encoded in a message's float."""

    @abstractmethod
    def _answer(self, name: str) -> Message:
        """PARAM_VALUE after a set, or a read by name."""
