"""Opens the wires of a URL: this machine's, or SITL's. Drivers cannot distinguish them."""

from companion.drivers.wires.bus import Wires
from companion.drivers.wires.linux_wires import LinuxWires
from companion.drivers.wires.prompt import PromptWires
from companion.drivers.wires.served_bus import ServedBus


def open_bus(url: str) -> Wires:
    """The wires of this machine, with the I2C adapter "/dev/i2c-N", or of "sitl://HOST:PORT".

    Raises:
        SensorError: the wires are not available; names the url and the remedy.
    """
    if url.startswith("sitl://"):
        host, port = url.removeprefix("sitl://").rsplit(":", 1)
        return ServedBus(host, int(port))
    return PromptWires(LinuxWires(url))
