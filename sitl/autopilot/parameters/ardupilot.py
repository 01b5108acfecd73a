"""ArduPilot's parameter protocol: every number travels as a float, and whatever fits is taken."""

import math

from sitl.autopilot.parameters.protocol import NO_INDEX, Parameters
from sitl.autopilot.parameters.table import Parameter
from sitl.autopilot.streams import Message


class ArduPilotParameters(Parameters):
    """As measured on ArduCopter 4.6.3, and in its GCS_Param.cpp."""

    listed_per_step = 16
    """1419 parameters were listed in 0.9 s."""

    def _taken(self, parameter: Parameter, message: Message) -> float | None:
        """The type in the message does not matter; too much for the true type becomes its most."""
        value: float = message.param_value
        return parameter.fitted(value) if math.isfinite(value) else None

    def _wire(self, value: float, kind: int) -> float:
        return value

    def _answer(self, name: str) -> Message:
        return self._value_message(name, NO_INDEX)
