"""What else is on the wires, where a sensor is not found: an address away, or at another rate."""

from collections.abc import Sequence

from companion.config.range_sensors import RangeSensor, SharpOnAds1115, TfminiSensor, Vl53l1xSensor
from companion.drivers.chips.tfmini import latest_frame
from companion.drivers.wires.bus import Transaction, Wires

ADS1115_ADDRESSES = range(0x48, 0x4C)
MUX_ADDRESSES = range(0x70, 0x78)
VL53L1X_ADDRESSES = (0x29,)
REMEMBERED_BYTES = 64


def answering(wires: Wires, addresses: range | tuple[int, ...]) -> list[int]:
    """The I2C addresses at which something acknowledges."""
    found = []
    for address in addresses:
        try:
            wires.transfer([Transaction(address, b"\x00", 1)])
        except OSError:
            continue
        found.append(address)
    return found


def wiring_remedy(wires: Wires, sensor: RangeSensor) -> str:
    """Where something of its kind does answer; or nothing."""
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
        return "; nothing like it answers anywhere: check SDA, SCL and supply"
    return "; something answers at " + ", ".join(f"0x{address:02x}" for address in addresses)


class Overheard:
    """Wires that remember what has lately come in at the serial ports; else as they are."""

    def __init__(self, wires: Wires) -> None:
        self._wires = wires
        self._heard: dict[str, bytes] = {}

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        return self._wires.transfer(transactions)

    def exchange(self, device: str, data: bytes) -> bytes:
        return self._wires.exchange(device, data)

    def receive(self, port: str, baud: int) -> bytes:
        data = self._wires.receive(port, baud)
        self._heard[port] = (self._heard.get(port, b"") + data)[-REMEMBERED_BYTES:]
        return data

    def close(self) -> None:
        self._wires.close()

    def remedy(self, sensor: TfminiSensor) -> str:
        """Why a serial sensor tells no distance."""
        data = self._heard.get(sensor.port, b"")
        if not data:
            return f"nothing comes in at {sensor.port}: swap TX and RX, and check its 5 V"
        if latest_frame(data)[0] is None:
            return f"bytes, but no frames: its baud rate is not {sensor.baud} (shipped: 115200)"
        return "its light is saturated: something shines into it"
