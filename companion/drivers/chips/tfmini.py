"""Benewake TFmini-S and TF-Luna: frames of nine bytes, 100 a second, at a serial port.

A frame consists of two bytes 0x59, then distance in cm, strength and temperature, each low byte
first, and the low byte of the sum of all eight. Source: product manuals, standard data output.
"""

import struct

from companion.core.errors import SensorError
from companion.core.messages import RangeReading
from companion.drivers.chips.time_of_flight import TimeOfFlight
from companion.drivers.readings import NOTHING, Latest
from companion.drivers.wires.bus import Uart

HEADER = b"\x59\x59"
"""Begin of a frame."""
FRAME = struct.Struct("<2sHHHB")
"""Header, distance in cm, strength, temperature, checksum."""
WEAK = 100
"""Strength below which a distance is invalid, because too little light returned."""
SATURATED = 0xFFFF
"""Strength of a saturated receiver."""
NO_SIGNAL = 0xFFFF
"""Distance -1."""
MIN_FAULT, MAX_FAULT = 0x8000, 0xFFFE
"""Other negative distances: -2 and -4 are reported with saturation by its own and by ambient
light."""


def checksum(body: bytes) -> int:
    return sum(body) & 0xFF


def latest_frame(data: bytes) -> tuple[tuple[int, int] | None, bytes]:
    """Distance in cm and strength of the last complete frame, and the remaining bytes."""
    found, at = None, 0
    while (start := data.find(HEADER, at)) >= 0 and start + FRAME.size <= len(data):
        frame = data[start : start + FRAME.size]
        _, distance_cm, strength, _, received = FRAME.unpack(frame)
        if received == checksum(frame[:-1]):
            found, at = (distance_cm, strength), start + FRAME.size
        else:  # garbage, or distance and strength that resemble a header
            at = start + 1
    return found, data[max(at, len(data) - FRAME.size + 1) :]


class Tfmini:
    """One sensor. A port has no identity: silence and garbage are detected by reads.

    Raises:
        SensorError: there is no such port.
    """

    def __init__(self, uart: Uart, port: str, baud: int, model: TimeOfFlight) -> None:
        self._uart = uart
        self._port = port
        self._baud = baud
        self.model = model
        self._rest = b""
        self._latest = Latest()
        try:
            uart.receive(port, baud)  # the age of bytes received before is unknown
        except SensorError:
            raise
        except OSError as error:
            raise SensorError(f"{port}: {error}; check sensors.ranges.*.port") from error

    def read(self, time_s: float) -> RangeReading | None:
        """The latest reading; None if the sensor is silent or saturated by light."""
        try:
            data = self._uart.receive(self._port, self._baud)
        except OSError:
            self._rest = b""
            return None
        frame, self._rest = latest_frame(self._rest + data)
        if frame is not None:
            self._latest.note(time_s, self._reading(*frame))
        return self._latest.at(time_s)

    def _reading(self, distance_cm: int, strength: int) -> RangeReading | None:
        if strength == SATURATED or MIN_FAULT <= distance_cm <= MAX_FAULT:
            return None
        if strength < WEAK or distance_cm == NO_SIGNAL:
            return NOTHING
        return self.model.reading(distance_cm * 1e-2)
