"""ArduPilot's parameter protocol: numbers travel as floats, and any finite value is accepted."""

import math

from sitl.autopilot.parameters.protocol import NO_INDEX, Parameters
from sitl.autopilot.parameters.table import Parameter
from sitl.autopilot.streams import Message


class ArduPilotParameters(Parameters):
    """Protocol as measured on ArduCopter 4.6.3, and from its GCS_Param.cpp."""

    listed_per_step = 16
    """Measured: 1419 parameters were listed in 0.9 s."""

    def _taken(self, parameter: Parameter, message: Message) -> float | None:
        """The message's type is ignored; a value is clamped to the range of the true type."""
        value: float = message.param_value
        return parameter.fitted(value) if math.isfinite(value) else None

    def _wire(self, value: float, kind: int) -> float:
        return value

    def _answer(self, name: str) -> Message:
        return self._value_message(name, NO_INDEX)
