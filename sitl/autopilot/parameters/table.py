"""The parameters of a firmware: names, types, defaults and documented ranges, from data files."""

import csv
import difflib
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.core.errors import SitlError

INTEGER_BITS = {
    mavlink.MAV_PARAM_TYPE_INT8: 8,
    mavlink.MAV_PARAM_TYPE_INT16: 16,
    mavlink.MAV_PARAM_TYPE_INT32: 32,
}
MAX_REAL32 = 3.4028234663852886e38
NUDGE = 0.01
"""How much ArduPilot adds before it cuts the decimals off, against 2.9999999."""


class ParameterError(SitlError):
    """A parameter that cannot be used."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter."""

    name: str
    kind: int
    """MAV_PARAM_TYPE."""
    default: float
    """The firmware's."""
    least: float
    most: float
    """The documented range, infinite where there is none; no autopilot holds anyone to it."""

    def fitted(self, value: float) -> float:
        """The nearest value that the type can hold, in the way of ArduPilot's `set_float`."""
        bits = INTEGER_BITS.get(self.kind)
        if bits is None:
            (held,) = struct.unpack("<f", struct.pack("<f", _clamped(value, MAX_REAL32)))
            return float(held)
        most = 2 ** (bits - 1) - 1
        return float(max(-most - 1, min(most, int(value + math.copysign(NUDGE, value)))))


Table = Mapping[str, Parameter]
"""By name, in the order in which they are listed."""


@cache
def load_table(firmware: str) -> Table:
    """Those of "ardupilot" or "px4"."""
    file = resources.files("sitl.autopilot.parameters") / f"{firmware}.csv"
    rows = csv.DictReader(file.read_text(encoding="utf-8").splitlines())
    return {row["name"]: _parameter(row) for row in rows}


def named(table: Table, name: str) -> Parameter:
    """The parameter of that name.

    Raises:
        ParameterError: there is none; the line names what is meant, if that can be guessed.
    """
    if name in table:
        return table[name]
    alike = difflib.get_close_matches(name.upper(), table, n=3)
    remedy = f"did you mean {' or '.join(alike)}?" if alike else "leave it out"
    raise ParameterError(f"this autopilot has no parameter {name}; {remedy}")


def initial_values(table: Table, values: Mapping[str, float]) -> dict[str, float]:
    """What every parameter holds at the start: the given value, else its default.

    Raises:
        ParameterError: a value is given for a name that the table does not have.
    """
    given = {name: named(table, name).fitted(value) for name, value in values.items()}
    return {name: p.fitted(p.default) for name, p in table.items()} | given


def _parameter(row: dict[str, str]) -> Parameter:
    return Parameter(
        name=row["name"],
        kind=getattr(mavlink, f"MAV_PARAM_TYPE_{row['type']}"),
        default=float(row["default"]),
        least=float(row["min"] or -math.inf),
        most=float(row["max"] or math.inf),
    )


def _clamped(value: float, most: float) -> float:
    return max(-most, min(most, value))
