"""What is known of each beam's sensor from its kind alone."""

from collections.abc import Mapping, Sequence

from companion.config import SensorsConfig
from companion.drivers.autopilot import AutopilotRangeModel
from companion.drivers.sharp import PROFILES
from companion.drivers.time_of_flight import SERIAL_KINDS, VL53L1X
from companion.messages import Beam, RangeModel
from companion.range_config import (
    AutopilotRange,
    RangeSensor,
    SharpOnAds1115,
    SharpOnMcp3008,
    TfminiSensor,
    Vl53l1xSensor,
)
from companion.values import value


def range_models(config: SensorsConfig) -> dict[Beam, RangeModel]:
    """Noise, bounds and age of each beam's readings."""
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


def folding_beams(config: SensorsConfig) -> list[Beam]:
    """Those whose sensor reads metres when something is very near."""
    return [
        beam
        for beam, sensor in config.beams.items()
        if isinstance(sensor, SharpOnAds1115 | SharpOnMcp3008) and sensor.curve == "gp2y0a710k0f"
    ]


@value
class LeastOf:
    """Several kinds of sensor taken for one: no better than the worst of them; a `RangeModel`."""

    models: tuple[RangeModel, ...]

    @property
    def min_m(self) -> float:
        return max(model.min_m for model in self.models)

    @property
    def max_m(self) -> float:
        return min(model.max_m for model in self.models)

    @property
    def gain_sigma(self) -> float:
        return max(model.gain_sigma for model in self.models)

    @property
    def mean_age_s(self) -> float:
        return sum(model.mean_age_s for model in self.models) / len(self.models)

    def sigma_m(self, distance_m: float) -> float:
        """Each at that distance, or at the end of its range that is nearer to it."""
        return max(
            model.sigma_m(min(max(distance_m, model.min_m), model.max_m)) for model in self.models
        )


def as_one(models: Mapping[Beam, RangeModel]) -> RangeModel:
    """For an estimator that knows one kind of sensor: the beams around, or what there is."""
    around: Sequence[RangeModel] = [
        model for beam, model in models.items() if beam not in (Beam.UP, Beam.DOWN)
    ] or list(models.values())
    first = around[0]
    return first if all(model == first for model in around) else LeastOf(tuple(around))
