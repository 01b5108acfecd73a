"""Measurement models of the beams' sensors, by sensor type."""

from companion.config.range_sensors import (
    AutopilotRange,
    RangeSensor,
    SharpOnAds1115,
    SharpOnMcp3008,
    TfminiSensor,
    Vl53l1xSensor,
)
from companion.config.settings import SensorsConfig
from companion.core.messages import BEARING_FRD_RAD, Beam, RangeModel, RangeUnit
from companion.drivers.autopilot import AutopilotRangeModel
from companion.drivers.chips.sharp import PROFILES
from companion.drivers.chips.time_of_flight import SERIAL_KINDS, VL53L1X


def range_models(config: SensorsConfig) -> dict[Beam, RangeModel]:
    """Noise, limits and age of each beam's readings."""
    return {beam: model_of(sensor) for beam, sensor in config.beams.items()}


def model_of(sensor: RangeSensor) -> RangeModel:
    match sensor:
        case SharpOnAds1115() | SharpOnMcp3008():
            return PROFILES[sensor.curve]
        case Vl53l1xSensor():
            return VL53L1X
        case TfminiSensor():
            return SERIAL_KINDS[sensor.kind]
        case AutopilotRange():
            return AutopilotRangeModel(sensor.min_m, sensor.max_m, sensor.sigma_m)


def level_units(sensors: SensorsConfig) -> dict[Beam, RangeUnit]:
    """Return the horizontal sensors; `Mounts` reduces all to one distance from the centre."""
    return {
        beam: RangeUnit(model, sensors.bearing_of_rad(beam), sensors.mount_offset_m)
        for beam, model in range_models(sensors).items()
        if beam in BEARING_FRD_RAD
    }
