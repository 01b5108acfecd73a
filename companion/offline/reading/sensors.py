"""Sensor models of a log: the `[sensors]` table of a TOML file beside it.

A key of the table applies to all beams, one of `[sensors.front]` and so on to that beam. Missing
values are estimated from the log.
"""

import math
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field, model_validator

from companion.config.range_sensors import Group
from companion.config.toml_file import read_toml, validated
from companion.core.messages import BEARING_FRD_RAD, Beam


class RangeConfig(Group):
    """Noise, limits and mounting of a sensor."""

    offset_m: float | None = Field(None, ge=-2, le=2)
    """Distance from the drone's centre along its beam, m."""
    sigma_m: float | None = Field(None, gt=0, le=1)
    """Standard deviation at any distance."""
    sigma_per_m2: float | None = Field(None, ge=0, le=0.2)
    """Part of sigma that grows with the square of the distance; added as a root of squares."""
    min_m: float | None = Field(None, ge=0, le=10)
    max_m: float | None = Field(None, gt=0, le=200)


class BeamConfig(RangeConfig):
    """A horizontal beam."""

    bearing_deg: float | None = Field(None, ge=-360, le=360)
    """Clockwise from forward, seen from above."""


class SensorsConfig(RangeConfig):
    """Keys of all beams, and of individual ones."""

    front: BeamConfig = BeamConfig()
    right: BeamConfig = BeamConfig()
    back: BeamConfig = BeamConfig()
    left: BeamConfig = BeamConfig()
    up: RangeConfig = RangeConfig()
    down: RangeConfig = RangeConfig()

    @model_validator(mode="after")
    def _min_below_max(self) -> "SensorsConfig":
        for beam in Beam:
            one = self.of(beam)
            if one.min_m is not None and one.max_m is not None and one.min_m >= one.max_m:
                raise ValueError(
                    f"{beam}: min_m = {one.min_m:g} should be less than max_m = {one.max_m:g}"
                )
        return self

    def of(self, beam: Beam) -> RangeConfig:
        """Settings of one beam: its own keys override the common ones."""
        own: RangeConfig = getattr(self, beam.value)
        values = {
            key: getattr(self, key) if getattr(own, key) is None else getattr(own, key)
            for key in RangeConfig.model_fields
        }
        return RangeConfig(**values)

    @property
    def has_noise(self) -> bool:
        """True if the file contains the noise of any beam."""
        beams = [self.of(beam) for beam in BEARING_FRD_RAD]
        return any(one.sigma_m is not None or one.sigma_per_m2 is not None for one in beams)

    def bearing_rad(self, beam: Beam) -> float:
        """Bearing clockwise from forward."""
        own: RangeConfig = getattr(self, beam.value)
        own_deg = getattr(own, "bearing_deg", None)
        return BEARING_FRD_RAD[beam] if own_deg is None else math.radians(own_deg)


class LogConfig(Group):
    """The whole file."""

    sensors: SensorsConfig = SensorsConfig()


def load(config: Path | None, log: Path) -> SensorsConfig:
    """Load the given file, or the one beside the log with its stem, or the defaults.

    Raises:
        ConfigError: one line with the error and its location.
    """
    stem = Path(log.stem).stem if log.suffix.lower() == ".gz" else log.stem
    path = config or log.parent / f"{stem}.toml"  # of a folder too, whose name may be empty
    if config is None and not path.is_file():
        return SensorsConfig()
    return validated(LogConfig, read_toml(path), str(path)).sensors


@dataclass(frozen=True, slots=True)
class RangeSensor:
    """A sensor whose noise has a constant part and a part that grows with distance squared."""

    min_m: float
    max_m: float
    constant_m: float
    per_m2: float
    gain_sigma: float = 0.0
    mean_age_s: float = 0.0

    def sigma_m(self, distance_m: float) -> float:
        """Standard deviation of a reading at a true distance."""
        return math.hypot(self.constant_m, self.per_m2 * distance_m**2)

    def alias_m(self, distance_m: float) -> float | None:
        """No aliasing."""
        return None
