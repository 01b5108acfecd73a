"""Reads a firmware's parameters from data files: names, types, defaults, documented ranges."""

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
"""Width of the integer types, bits, by MAV_PARAM_TYPE."""
MAX_REAL32 = 3.4028234663852886e38
"""Largest finite single-precision number (IEEE 754)."""
NUDGE = 0.01
"""ArduPilot adds this before it truncates the decimals, against 2.9999999."""


class ParameterError(SitlError):
    """A parameter is unknown or its value unusable."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a firmware."""

    name: str
    kind: int
    """MAV_PARAM_TYPE."""
    default: float
    """The firmware's default."""
    least: float
    most: float
    """The documented range, infinite if there is none. No autopilot enforces it."""

    def fitted(self, value: float) -> float:
        """The nearest value that the type can hold, as in ArduPilot's `set_float`."""
        bits = INTEGER_BITS.get(self.kind)
        if bits is None:
            (held,) = struct.unpack("<f", struct.pack("<f", _clamped(value, MAX_REAL32)))
            return float(held)
        most = 2 ** (bits - 1) - 1
        return float(max(-most - 1, min(most, int(value + math.copysign(NUDGE, value)))))


Table = Mapping[str, Parameter]
"""Parameters by name, in list order."""


@cache
def load_table(firmware: str) -> Table:
    """The table of firmware "ardupilot" or "px4"."""
    file = resources.files("sitl.autopilot.parameters") / f"{firmware}.csv"
    rows = csv.DictReader(file.read_text(encoding="utf-8").splitlines())
    return {row["name"]: _parameter(row) for row in rows}


def named(table: Table, name: str) -> Parameter:
    """The parameter of that name.

    Raises:
        ParameterError: there is none; the text suggests similar names.
    """
    if name in table:
        return table[name]
    alike = difflib.get_close_matches(name.upper(), table, n=3)
    remedy = f"did you mean {' or '.join(alike)}?" if alike else "leave it out"
    raise ParameterError(f"this autopilot has no parameter {name}; {remedy}")


def initial_values(table: Table, values: Mapping[str, float]) -> dict[str, float]:
    """Every parameter's value at the start: the given value or the default.

    Raises:
        ParameterError: a given name is not in the table.
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
