"""All that a flight touches outside itself, put together as the configuration says."""

from companion.clocks import Clock
from companion.config import Config
from companion.drivers.autopilot import AutopilotGyro
from companion.drivers.bus import Wires
from companion.drivers.gyro import calibrated, open_gyro
from companion.drivers.models import range_models
from companion.drivers.ranges import RangeSensors
from companion.fly import Rig
from companion.link.link import Link, Listener
from companion.link.reports import Reports
from companion.link.transport import Transport


def make_rig(config: Config, transport: Transport, wires: Wires, clock: Clock) -> Rig:
    """Sensors, gyro and link; those sensors that are the autopilot's listen at the link.

    Raises:
        SensorError: a sensor is missing or is not what it should be.
    """
    ranges = RangeSensors(wires, config.sensors)
    gyro = open_gyro(wires, config.sensors)
    listeners: list[Listener] = []
    if ranges.from_autopilot is not None:
        listeners.append(ranges.from_autopilot)
    if isinstance(gyro, AutopilotGyro):
        listeners.append(gyro)
    link = Link(transport, config.link, listeners)
    reports = Reports(config.link, range_models(config.sensors))
    return Rig(link, ranges, calibrated(gyro, config.sensors), clock, reports)
