"""Finds other addresses or baud rates at which a missing sensor answers."""

from collections.abc import Sequence

from companion.config.range_sensors import RangeSensor, SharpOnAds1115, TfminiSensor, Vl53l1xSensor
from companion.drivers.chips.tfmini import latest_frame
from companion.drivers.wires.bus import Transaction, Wires

ADS1115_ADDRESSES = range(0x48, 0x4C)
"""Possible I2C addresses of an ADS1115."""
MUX_ADDRESSES = range(0x70, 0x78)
"""Possible I2C addresses of a TCA9548A."""
VL53L1X_ADDRESSES = (0x29,)
"""I2C address of a VL53L1X after power-up."""
STORED_BYTES = 64
"""Bytes stored of each serial port. Chosen."""


def answering(wires: Wires, addresses: range | tuple[int, ...]) -> list[int]:
    """The I2C addresses that acknowledge."""
    found = []
    for address in addresses:
        try:
            wires.transfer([Transaction(address, b"\x00", 1)])
        except OSError:
            continue
        found.append(address)
    return found


def wiring_remedy(wires: Wires, sensor: RangeSensor) -> str:
    """Addresses at which a chip of this type may be; empty for serial sensors."""
    match sensor:
        case SharpOnAds1115():
            return _listed(answering(wires, ADS1115_ADDRESSES))
        case Vl53l1xSensor(mux_address=None):
            return _listed(answering(wires, VL53L1X_ADDRESSES))
        case Vl53l1xSensor():
            return _listed(answering(wires, MUX_ADDRESSES))
        case _:
            return ""


def _listed(addresses: list[int]) -> str:
    if not addresses:
        return "; no such address answers: check SDA, SCL and supply"
    return "; something answers at " + ", ".join(f"0x{address:02x}" for address in addresses)


class MonitoredWires:
    """Wires that store the last bytes received at the serial ports."""

    def __init__(self, wires: Wires) -> None:
        self._wires = wires
        self._received: dict[str, bytes] = {}

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        return self._wires.transfer(transactions)

    def exchange(self, device: str, data: bytes) -> bytes:
        return self._wires.exchange(device, data)

    def receive(self, port: str, baud: int) -> bytes:
        data = self._wires.receive(port, baud)
        self._received[port] = (self._received.get(port, b"") + data)[-STORED_BYTES:]
        return data

    def close(self) -> None:
        self._wires.close()

    def remedy(self, sensor: TfminiSensor) -> str:
        """Reason and remedy for a serial sensor without a distance."""
        data = self._received.get(sensor.port, b"")
        if not data:
            return f"no bytes received at {sensor.port}: swap TX and RX, and check its 5 V"
        if latest_frame(data)[0] is None:
            return f"bytes but no frames: its baud rate is not {sensor.baud} (factory: 115200)"
        return "its receiver is saturated: strong light shines into it"
