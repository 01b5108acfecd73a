"""Emulates TFmini-S and TF-Luna at their serial port: a stream of frames.

All constants of a frame are those of the product manuals, not of the companion's driver.
"""

import struct

from sitl.sensors.time_of_flight import TofUnit

BAUD = 115200
"""Default rate of the port, baud (product manuals)."""
HEADER = b"\x59\x59"
"""First two bytes of a frame (TFmini-S manual, table 7)."""
FIELDS = struct.Struct("<HHH")
"""Distance, cm, strength, and temperature, each low byte first, after the header (TFmini-S manual,
table 7). The ninth byte is the low byte of the sum of the eight before it."""
NO_SIGNAL = 0xFFFF
"""Distance -1: the strength is too low for a distance (TFmini-S manual, table 8)."""
STRONG, WEAK = 2000, 20
"""Strength with and without a target. Chosen: above and below 100, under which a distance is
unreliable (product manuals)."""
TEMPERATURE = (45 + 256) * 8
"""Temperature field of a frame at 45 °C: °C = field / 8 - 256 (product manuals)."""
BUFFERED_FRAMES = 450
"""Frames in Linux's buffer of 4095 bytes when nothing reads the port."""


def frame(distance_m: float | None) -> bytes:
    """One measurement as a frame; None means that too little light returned."""
    fields = (NO_SIGNAL, WEAK) if distance_m is None else (round(100 * distance_m), STRONG)
    body = HEADER + FIELDS.pack(*fields, TEMPERATURE)
    return body + bytes([sum(body) & 0xFF])


class TfminiDevice:
    """One sensor. A port at a different baud rate receives different bytes."""

    def __init__(self, unit: TofUnit) -> None:
        self._unit = unit
        self._sent = 0
        self.noise = b""
        """A fault for tests: bytes received before the frames."""

    def sent(self, time_s: float, baud: int) -> bytes:
        """Bytes sent since the last call. Skipped frames repeat the latest one."""
        count = self._unit.count(time_s)
        due, self._sent = min(count - self._sent, BUFFERED_FRAMES), count
        if self._unit.is_unplugged:
            return b""
        data = self.noise + frame(self._unit.distance_m(time_s)) * due
        return data if baud == BAUD else bytes(value << 3 & 0xFF | 0x80 for value in data)
