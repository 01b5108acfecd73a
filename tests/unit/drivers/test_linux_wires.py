"""SPI and serial ports of a Linux machine on simulated devices: first use and reconnection."""

import sys
import termios
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest
import serial

from companion.core.errors import SensorError
from companion.drivers.wires.opening import open_bus


class SpiError(OSError):
    """Replaces periphery's error."""


class Spi:
    """Replaces periphery's SPI; adds one to every byte."""

    def __init__(self, device: str, mode: int, clock_hz: float) -> None:
        if device != "/dev/spidev0.1":
            raise SpiError(2, "No such file or directory")

    def transfer(self, data: bytes) -> bytes:
        return bytes(value + 1 for value in data)

    def close(self) -> None: ...


class Port:
    """Replaces a serial port that can be disconnected."""

    is_connected = True
    opened: ClassVar[list[tuple[str, int]]] = []

    def __init__(self, port: str, baud: int, **kwargs: Any) -> None:
        if not Port.is_connected:
            raise serial.SerialException("could not open port")
        Port.opened.append((port, baud))

    @property
    def in_waiting(self) -> int:
        if not Port.is_connected:
            raise OSError(5, "Input/output error")
        return 3

    def read(self, count: int) -> bytes:
        return b"abc"[:count]

    def close(self) -> None: ...


@pytest.fixture(autouse=True)
def _simulated_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    periphery = SimpleNamespace(SPI=Spi, SPIError=SpiError)
    monkeypatch.setitem(sys.modules, "periphery", periphery)
    monkeypatch.setattr(serial, "Serial", Port)
    monkeypatch.setattr(Port, "is_connected", True)
    monkeypatch.setattr(Port, "opened", [])


def test_a_device_is_not_opened_before_its_first_use() -> None:
    open_bus("/dev/i2c-99").close()


def test_an_exchange_uses_the_named_device() -> None:
    wires = open_bus("/dev/i2c-99")
    assert wires.exchange("/dev/spidev0.1", b"\x01\x02") == b"\x02\x03"
    with pytest.raises(SensorError, match=r"/dev/spidev1\.0.*enable SPI"):
        wires.exchange("/dev/spidev1.0", b"\x01")


def test_a_reconnected_port_is_opened_again(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [0.0]
    monkeypatch.setattr("companion.drivers.wires.linux_wires.time.monotonic", lambda: now_s[0])
    wires = open_bus("/dev/i2c-99")
    assert wires.receive("/dev/ttyUSB0", 115200) == b"abc"
    Port.is_connected = False
    for _ in range(3):
        now_s[0] += 0.4
        with pytest.raises(OSError, match=r"ttyUSB0|Input/output"):
            wires.receive("/dev/ttyUSB0", 115200)
    Port.is_connected = True
    now_s[0] += 1.5
    assert wires.receive("/dev/ttyUSB0", 115200) == b"abc"
    assert Port.opened == [("/dev/ttyUSB0", 115200)] * 2


def test_a_missing_port_is_an_error_with_the_remedy() -> None:
    Port.is_connected = False
    with pytest.raises(SensorError, match="dialout"):
        open_bus("/dev/i2c-99").receive("/dev/ttyUSB0", 115200)


def test_a_port_that_is_unplugged_while_it_is_opened_is_an_error_of_the_sensor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Pyserial passes the error of tcsetattr(), which is no OSError; in flight it ended all."""

    def unplugged(port: str, baud: int, **kwargs: object) -> None:
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr(serial, "Serial", unplugged)
    with pytest.raises(SensorError, match=r"ttyUSB0.*Input/output"):
        open_bus("/dev/i2c-99").receive("/dev/ttyUSB0", 115200)


def test_a_missing_i2c_adapter_is_an_error_with_the_remedy() -> None:
    from companion.drivers.wires.bus import Transaction  # noqa: PLC0415 - only this test needs it

    with pytest.raises(SensorError, match="raspi-config"):
        open_bus("/dev/i2c-99").transfer([Transaction(0x48, b"\x00")])
