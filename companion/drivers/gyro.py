"""Opens the configured gyro."""

from typing import Protocol

from companion.config.settings import SensorsConfig
from companion.core.messages import GyroSample
from companion.drivers.autopilot_gyro import AutopilotGyro
from companion.drivers.chips.lsm9ds1 import Lsm9ds1
from companion.drivers.wires.bus import Bus


class Gyro(Protocol):
    """Yaw rate about the body's down axis."""

    def read(self, time_s: float) -> list[GyroSample]:
        """All samples since the last read; [] on a fault."""
        ...


class Calibrated:
    """Corrects a gyro that reads `gain` times the rate."""

    def __init__(self, gyro: Gyro, gain: float) -> None:
        self._gyro = gyro
        self._gain = gain

    def read(self, time_s: float) -> list[GyroSample]:
        return [
            GyroSample(sample.time_s, sample.yaw_rate_rad_s / self._gain)
            for sample in self._gyro.read(time_s)
        ]


def open_gyro(bus: Bus, config: SensorsConfig) -> Lsm9ds1 | AutopilotGyro:
    """Open our gyro, or the autopilot's, which must receive MAVLink messages; not yet calibrated.

    Raises:
        SensorError: there is no gyro at the address.
    """
    return AutopilotGyro() if config.gyro == "autopilot" else Lsm9ds1(bus, config.gyro_address)


def calibrated(gyro: Gyro, config: SensorsConfig) -> Gyro:
    """Wrap a gyro to correct its gain."""
    return gyro if config.gyro_gain == 1.0 else Calibrated(gyro, config.gyro_gain)
