"""Configuration: typed groups with unit, default and bounds, read from one TOML file.

Whatever cannot be used ends in a `ConfigError` of one line that names file, key, value and what
is allowed; an unknown key is refused, never ignored.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationError

from companion.errors import ConfigError
from companion.messages import Beam

MissionKind = Literal["room", "building", "exterior", "layers"]
STANDOFFS = ("range", "accurate")
LEAST_STANDOFF_M, MOST_STANDOFF_M = 0.6, 5.0


def _standoff(value: object) -> object:
    if value in STANDOFFS:
        return value
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if is_number and LEAST_STANDOFF_M <= value <= MOST_STANDOFF_M:  # type: ignore[operator]
        return float(value)  # type: ignore[arg-type]
    names = " or ".join(repr(name) for name in STANDOFFS)
    raise ValueError(
        f"should be from {LEAST_STANDOFF_M:g} to {MOST_STANDOFF_M:g} metres, or {names}"
    )


Standoff = Annotated[float | Literal["range", "accurate"], PlainValidator(_standoff)]


class _Group(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class LinkConfig(_Group):
    """MAVLink to the autopilot."""

    url: str = Field("udpin:127.0.0.1:14550", pattern=r"^(udpin|udpout):[^:]+:\d{1,5}$")
    """udpin waits for the autopilot at this address; udpout speaks first."""
    system_id: int = Field(1, ge=1, le=255)
    """The vehicle's system id, which the companion shares."""
    component_id: int = Field(191, ge=1, le=255)
    """MAV_COMP_ID_ONBOARD_COMPUTER."""
    origin_lat_deg: float = Field(47.3977, ge=-90, le=90)
    """Where on Earth the autopilot is told to be; roughly right is good enough for its compass.
    All three at zero count as not told."""
    origin_lon_deg: float = Field(8.5456, ge=-180, le=180)
    origin_alt_m: float = Field(488.0, ge=-500, le=9000)


class AdcChannel(_Group):
    """Where a Sharp sensor is wired."""

    address: int = Field(ge=0x48, le=0x4B)
    """I2C address of the ADS1115."""
    channel: int = Field(ge=0, le=3)


class SensorsConfig(_Group):
    """Range sensors and gyro."""

    bus: str = Field("/dev/i2c-1", pattern=r"^(/dev/i2c-\d+|sitl://[^:]+:\d{1,5})$")
    profile: Literal["gp2y0a710k0f", "paper"] = "gp2y0a710k0f"
    channels: dict[Beam, AdcChannel] = {
        Beam.FRONT: AdcChannel(address=0x48, channel=0),
        Beam.LEFT: AdcChannel(address=0x48, channel=1),
        Beam.RIGHT: AdcChannel(address=0x48, channel=2),
        Beam.UP: AdcChannel(address=0x49, channel=0),
        Beam.DOWN: AdcChannel(address=0x49, channel=1),
    }
    mount_offset_m: float = Field(0.08, ge=0, le=1)
    """How far from the drone's centre each sensor sits, along its own beam."""
    gyro_address: int = Field(0x6B, ge=0x6A, le=0x6B)
    rest_s: float = Field(3.0, ge=1, le=60)
    """How long the gyro's bias is averaged before arming."""


class MissionConfig(_Group):
    """How the room is flown."""

    kind: MissionKind = "room"
    """room: trace the walls of one room; building: see everything that can be reached; exterior:
    go round whatever stands there, and not far off; layers: a building at several heights."""
    height_m: float = Field(1.2, ge=0.5, le=10)
    standoff: Standoff = 1.5
    """Of the room's trace: metres, or as far as the sensor reaches, or where it is most exact."""
    layer_spacing_m: float = Field(0.6, ge=0.2, le=5)
    """Between the layers, from `height_m` up to the ceiling."""
    speed_m_s: float = Field(1.0, ge=0.1, le=2)
    turn_rate_deg_s: float = Field(45.0, ge=10, le=90)
    clearance_m: float = Field(0.3, ge=0.1, le=2)
    """Between the drone's body and anything, as far as the mission plans it."""
    time_limit_s: float = Field(600.0, gt=0, le=3600)
    """Of the flight: the drone turns back in time to be home by then."""
    reserve_s: float = Field(20.0, ge=0, le=600)
    """Left of the limit when it is home."""


class Config(_Group):
    """Everything that can be set."""

    link: LinkConfig = LinkConfig()
    sensors: SensorsConfig = SensorsConfig()
    mission: MissionConfig = MissionConfig()


def load(path: Path | None, overrides: Mapping[str, object] | None = None) -> Config:
    """The configuration in `path`, or the defaults, with `overrides` such as {"link.url": ...}.

    Raises:
        ConfigError: one line that says what to mend.
    """
    source = str(path) if path else "command line"
    values: dict[str, Any] = _read(path) if path else {}
    for key, value in (overrides or {}).items():
        group, name = key.split(".")
        values[group] = {**values.get(group, {}), name: value}
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        raise ConfigError(f"{source}: {_first_complaint(error)}") from error


def to_toml(config: Config) -> str:
    """The text of a file that `load` makes the same configuration of."""
    return tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text())
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not TOML: {error}") from error


def _first_complaint(error: ValidationError) -> str:
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        known = ", ".join(sorted(_keys_at(first["loc"][:-1])))
        return f"{key} = {first['input']!r}: no such key; known here: {known}"
    complaint = first["msg"].removeprefix("Value error, ").replace("Input should", "should")
    return f"{key} = {first['input']!r}: {complaint}"


def _keys_at(path: tuple[int | str, ...]) -> list[str]:
    group: type[BaseModel] = Config
    for part in path:
        annotation = group.model_fields[str(part)].annotation if group else None
        if not (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
            return ["address", "channel"]
        group = annotation
    return list(group.model_fields)
