"""The gyro that the configuration names."""

from typing import Protocol

from companion.config import SensorsConfig
from companion.drivers.autopilot import AutopilotGyro
from companion.drivers.bus import Bus
from companion.drivers.lsm9ds1 import Lsm9ds1
from companion.messages import GyroSample


class Gyro(Protocol):
    """Yaw rate about the body's down axis."""

    def read(self, time_s: float) -> list[GyroSample]:
        """All samples since the last read; [] on a fault."""
        ...


def open_gyro(bus: Bus, config: SensorsConfig) -> Lsm9ds1 | AutopilotGyro:
    """Ours, or the autopilot's, which is to be told of its messages.

    Raises:
        SensorError: there is no gyro at the address.
    """
    return AutopilotGyro() if config.gyro == "autopilot" else Lsm9ds1(bus, config.gyro_address)
