"""The TFmini-S and TF-Luna as their serial port sees them: a stream of frames."""

from companion.drivers.chips.tfmini import FRAME, HEADER, NO_SIGNAL, checksum
from sitl.sensors.time_of_flight import TofUnit

BAUD = 115200
STRONG, WEAK = 2000, 20
TEMPERATURE = (45 + 256) * 8
"""45 °C."""
BUFFERED_FRAMES = 450
"""Linux keeps 4095 bytes for a reader who does not come."""


def frame(distance_m: float | None) -> bytes:
    """One measurement; None: too little light came back."""
    told = (NO_SIGNAL, WEAK) if distance_m is None else (round(100 * distance_m), STRONG)
    body = FRAME.pack(HEADER, *told, TEMPERATURE, 0)[:-1]
    return body + bytes([checksum(body)])


class TfminiDevice:
    """One sensor; a port at another baud rate takes in something else than it sends."""

    def __init__(self, unit: TofUnit) -> None:
        self._unit = unit
        self._sent = 0
        self.noise = b""
        """A fault for tests: this comes in before all else."""

    def sent(self, time_s: float, baud: int) -> bytes:
        """Frames that nobody fetched repeat the latest one: only that counts for a reader."""
        count = self._unit.count(time_s)
        due, self._sent = min(count - self._sent, BUFFERED_FRAMES), count
        if self._unit.is_unplugged:
            return b""
        data = self.noise + frame(self._unit.distance_m(time_s)) * due
        return data if baud == BAUD else bytes(value << 3 & 0xFF | 0x80 for value in data)
