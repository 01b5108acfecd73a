"""Configuration: typed groups with units, defaults and bounds, read from one TOML file.

Every error is a `ConfigError` of one line with file, key, value and allowed values. Unknown keys
are rejected.
"""

import math
import tomllib
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

import tomlkit
from pydantic import (
    Field,
    PlainValidator,
    ValidationError,
    WithJsonSchema,
    model_validator,
)

from companion.config.preflight import PreflightConfig
from companion.config.range_places import check_places
from companion.config.range_sensors import (
    AdcChannel,
    Calibration,
    Group,
    Profile,
    RangeSensor,
    TfminiSensor,
    usual_channels,
    usual_sensors,
)
from companion.config.team import TEAM_DRONES, TeamConfig
from companion.config.toml_file import complaint, read_toml, text_of
from companion.config.view import ViewConfig
from companion.core.errors import ConfigError
from companion.core.frames import Place
from companion.core.messages import BEARING_FRD_RAD, Beam

MissionKind = Literal["room", "building", "exterior", "layers"]
MISSION_KINDS: tuple[str, ...] = get_args(MissionKind)
COMMAND_LINE = "command line"
"""Where settings come from that no file has, for messages."""
STANDOFFS = ("range", "accurate")
"""Named stand-offs of `mission.standoff`."""
MIN_STANDOFF_M, MAX_STANDOFF_M = 0.6, 5.0
"""Bounds of `mission.standoff`, m. Chosen."""
BELOW_TOP_M = 0.3
"""Distance of all commanded heights below `mission.max_height_m`, m. PX4 overshot by 0.28 m at a
take-off (docs/autopilot.md)."""


def _standoff(value: object) -> object:
    if value in STANDOFFS:
        return value
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if is_number and MIN_STANDOFF_M <= value <= MAX_STANDOFF_M:  # type: ignore[operator]
        return float(value)  # type: ignore[arg-type]
    names = " or ".join(repr(name) for name in STANDOFFS)
    raise ValueError(f"should be from {MIN_STANDOFF_M:g} to {MAX_STANDOFF_M:g} metres, or {names}")


Standoff = Annotated[
    float | Literal["range", "accurate"],
    PlainValidator(_standoff),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": MIN_STANDOFF_M, "maximum": MAX_STANDOFF_M},
                {"type": "string", "enum": list(STANDOFFS)},
            ]
        }
    ),
]


class LinkConfig(Group):
    """The MAVLink connection to the autopilot."""

    url: str = Field(
        "udpin:127.0.0.1:14550",
        pattern=r"^((udpin|udpout):[^:]+:\d{1,5}|serial:/dev/\S+:\d{4,7})$",
    )
    """`udpin:HOST:PORT` waits there for the autopilot, `udpout:HOST:PORT` sends first,
    `serial:/dev/PORT:BAUD` opens a serial port."""
    system_id: int = Field(1, ge=1, le=255)
    """MAVLink system id of the vehicle, which the companion shares."""
    component_id: int = Field(191, ge=1, le=255)
    """MAVLink component id of the companion. The default is MAV_COMP_ID_ONBOARD_COMPUTER."""
    signing_key: Path | None = None
    """File with 64 hexadecimal digits, mode 600. With a key, frames are signed, and received frames
    without a valid signature are refused. Default: no signing."""
    signing_timestamp: Path | None = None
    """File that keeps the latest signing time stamp. Default: beside the key."""
    tell_ranges: Literal["none", "distance_sensor", "obstacle_distance"] = "none"
    """Message in which the autopilot receives the range readings, for its own avoidance and terrain
    following. Ground stations receive it, too."""
    tell_texts: bool = True
    """Send phases and faults as STATUSTEXT, for ground stations."""
    origin_lat_deg: float = Field(47.3977, ge=-90, le=90)
    """Latitude of the origin that an autopilot without one is given. An approximate place is good
    enough for its compass. Autopilots take zero in all three keys for no origin."""
    origin_lon_deg: float = Field(8.5456, ge=-180, le=180)
    """Longitude of that origin."""
    origin_alt_m: float = Field(488.0, ge=-500, le=9000)
    """Altitude of that origin above mean sea level."""
    send_pose: bool = False
    """Send the companion's pose to the autopilot as ODOMETRY. The autopilot's parameters must
    enable its use."""
    set_fence: bool = False
    """Write `mission.max_height_m` and `max_distance_m` to the autopilot, as a fence 1 m farther at
    which it lands. Otherwise its fence is only checked."""
    setpoint_loss_s: float = Field(0.5, ge=0.2, le=5)
    """Time after the last setpoint at which ArduPilot stops and PX4 lands. The companion sets it in
    the autopilot. A larger value bridges pauses of the computer and needs a lower speed."""

    @property
    def serial_port(self) -> str | None:
        """Path of the serial port, which may contain colons (/dev/serial/by-path); else None."""
        kind, _, address = self.url.partition(":")
        return address.rpartition(":")[0] if kind == "serial" else None

    @property
    def place(self) -> Place | None:
        """The origin, if it is set; None for the default, which is near no drone in particular."""
        fields = type(self).model_fields
        default = fields["origin_lat_deg"].default, fields["origin_lon_deg"].default
        own = self.origin_lat_deg, self.origin_lon_deg
        return None if own == default else Place(*own)


class SensorsConfig(Group):
    """Range sensors and gyro."""

    bus: str = Field("/dev/i2c-1", pattern=r"^(/dev/i2c-\d+|sitl://[^:]+:\d{1,5})$")
    """I2C adapter, `/dev/i2c-N`, with SPI devices and serial ports of this machine; or
    `sitl://HOST:PORT`, the simulator's."""
    profile: Profile = "gp2y0a710k0f"
    """Five sensors of one kind with their default wiring."""
    ranges: dict[Beam, RangeSensor] = Field(default_factory=dict)
    """Sensor of each beam. If any is given, `profile` and `channels` have no effect."""
    calibration: dict[Beam, Calibration] = Field(default_factory=dict)
    """Calibration of each sensor, written by `companion calibrate range`. Default: none."""
    channels: dict[Beam, AdcChannel] = Field(default_factory=usual_channels)
    """ADS1115 input of each Sharp sensor of `profile`. Default: front, left and right on channels
    0 to 2 of 0x48, up and down on channels 0 and 1 of 0x49."""
    mount_offset_m: float = Field(0.08, ge=0, le=1)
    """Distance from the drone's centre to each range sensor, along its beam."""
    gyro: Literal["lsm9ds1", "autopilot"] = "lsm9ds1"
    """The LSM9DS1 on `bus`, or the autopilot's gyro, received as HIGHRES_IMU or SCALED_IMU."""
    gyro_gain: float = Field(1.0, ge=0.8, le=1.2)
    """Scale factor of the gyro: it reads gain × rate. Written by `companion calibrate gyro`."""
    gyro_address: int = Field(0x6B, ge=0x6A, le=0x6B)
    """I2C address of the LSM9DS1, 0x6A or 0x6B."""
    rest_s: float = Field(3.0, ge=1, le=60)
    """Time at rest before arming over which the gyro's bias is averaged."""

    @property
    def is_simulated(self) -> bool:
        """True on the simulator's bus, where no real drone flies."""
        return self.bus.startswith("sitl://")

    @cached_property
    def beams(self) -> dict[Beam, RangeSensor]:
        """The sensor of each beam."""
        return self.ranges or usual_sensors(self.profile, self.channels)

    def mount_of_m(self, beam: Beam) -> float:
        """Distance of the sensor from the drone's centre along its beam."""
        own = self.beams[beam].mount_offset_m
        return self.mount_offset_m if own is None else own

    def bearing_of_rad(self, beam: Beam) -> float:
        """Bearing of a level beam, clockwise from the nose."""
        own_deg = self.beams[beam].bearing_deg
        return BEARING_FRD_RAD[beam] if own_deg is None else math.radians(own_deg)

    @model_validator(mode="after")
    def _check_wiring(self) -> Self:
        check_places(self.beams, self.gyro_address if self.gyro == "lsm9ds1" else None)
        return self


class MissionConfig(Group):
    """The mission and its limits."""

    kind: MissionKind = "room"
    """`room` traces the walls of one room. `building` covers everything that can be reached.
    `exterior` flies round what stands there. `layers` is `building` at several heights."""
    height_m: float = Field(1.2, ge=0.5, le=10)
    """Flying height above the take-off point; of `layers`, that of the lowest layer."""
    standoff: Standoff = 1.5
    """Distance from the drone's centre to the wall of a room that it follows: metres, `range` for
    the farthest reliable one, or `accurate` for the one at which the sensor is most accurate."""
    max_height_m: float | None = Field(None, ge=0.8, le=50)
    """Height above the take-off point that the drone never exceeds, at least 0.3 m above
    `height_m`. Default: no limit but the ceiling."""
    max_distance_m: float | None = Field(None, ge=2, le=1000)
    """Horizontal distance from the take-off point that it never exceeds. Default: no limit."""
    layer_spacing_m: float = Field(0.6, ge=0.2, le=5)
    """Height between two layers, from `height_m` up to the ceiling."""
    speed_m_s: float = Field(1.0, ge=0.1, le=2)
    """Highest horizontal speed."""
    turn_rate_deg_s: float = Field(45.0, ge=10, le=90)
    """Highest turn rate."""
    clearance_m: float = Field(0.3, ge=0.1, le=2)
    """Planned clearance between the drone's hull and any obstacle."""
    time_limit_s: float = Field(600.0, gt=0, le=3600)
    """Longest flight. The drone turns back in time to be home by then."""
    reserve_s: float = Field(20.0, ge=0, le=600)
    """Time that is left of `time_limit_s` and of the battery when the drone is home."""
    after_crash: Literal["land", "resume"] = "land"
    """Action of `companion recover` with a drone in the air: land, or continue the mission with the
    map."""
    battery_home_percent: float = Field(20.0, ge=0, le=100)
    """Battery level at which the drone returns home; 0: never."""
    battery_land_percent: float = Field(10.0, ge=0, le=100)
    """Battery level at which the drone lands where it is, or on floor nearby."""

    @model_validator(mode="after")
    def _check_height(self) -> Self:
        if self.max_height_m is not None and self.height_m > self.max_height_m - BELOW_TOP_M:
            raise ValueError(
                f"height_m = {self.height_m:g}: should be at least {BELOW_TOP_M:g} m below "
                f"max_height_m = {self.max_height_m:g}"
            )
        return self


class RecordingConfig(Group):
    """The flight recorder."""

    enabled: bool = True
    """Record every flight, as docs/recording.md describes."""


class Config(Group):
    """The whole configuration file."""

    link: LinkConfig = LinkConfig()
    sensors: SensorsConfig = SensorsConfig()
    mission: MissionConfig = MissionConfig()
    preflight: PreflightConfig = PreflightConfig()
    recording: RecordingConfig = RecordingConfig()
    view: ViewConfig = ViewConfig()
    team: TeamConfig = TeamConfig()

    @model_validator(mode="after")
    def _check_team(self) -> Self:
        kind, drones = self.mission.kind, len(self.team.pads)
        if self.team.name and drones > TEAM_DRONES.get(kind, 1):
            by = ", ".join(f"{each} by up to {most}" for each, most in TEAM_DRONES.items())
            raise ValueError(f"mission.kind = {kind!r}: is not flown by a team of {drones}; {by}")
        return self

    @model_validator(mode="after")
    def _check_serial_ports(self) -> Self:
        for beam, sensor in self.sensors.beams.items():
            if isinstance(sensor, TfminiSensor) and sensor.port == self.link.serial_port:
                raise ValueError(
                    f"link.url and sensors.ranges.{beam.value}.port are both {sensor.port}; "
                    "give each a port of its own"
                )
        return self


def load(
    path: Path | None,
    overrides: Mapping[str, object] | None = None,
    sources: Mapping[str, str] | None = None,
) -> Config:
    """The configuration in `path`, or the defaults, with `overrides` such as {"link.url": ...}.

    `sources`: files from which overrides come that are not of the command line, by their keys.

    Raises:
        ConfigError: one line with the error and its location.
    """
    overrides = overrides or {}
    values: dict[str, Any] = read_toml(path) if path else {}
    for key, value in overrides.items():
        group, name = key.split(".", 1)
        values[group] = {**values.get(group, {}), name: value}
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        key = ".".join(str(part) for part in error.errors()[0]["loc"][:2])
        source = path if path and key not in overrides else COMMAND_LINE
        where = (sources or {}).get(key, source)
        raise ConfigError(f"{where}: {complaint(Config, error)}") from error


def mission_settings(assignments: Sequence[str]) -> dict[str, object]:
    """Convert command-line assignments, "speed_m_s=0.6" to {"mission.speed_m_s": 0.6}, for `load`.

    Raises:
        ConfigError: an assignment is not KEY=VALUE.
    """
    settings: dict[str, object] = {}
    for assignment in assignments:
        key, sign, text = assignment.partition("=")
        if not key or not sign:
            raise ConfigError(f"--set {assignment}: should be KEY=VALUE, as in speed_m_s=0.6")
        settings[f"mission.{key}"] = _toml_value(text)
    return settings


def _toml_value(text: str) -> object:
    """Parse a value as in a file; on the command line a word needs no quotes."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def to_toml(config: Config) -> str:
    """TOML text of a configuration, which `load` reads back unchanged."""
    return tomlkit.dumps(config.model_dump(mode="json", exclude_none=True))


def update(path: Path, key: str, value: Mapping[str, object] | float) -> None:
    """Set one key, such as "sensors.calibration.front", and keep the rest of the file.

    Raises:
        ConfigError: the file cannot be read or written, or would not be valid.
    """
    document = tomlkit.parse(text_of(path)) if path.exists() else tomlkit.document()
    group: Any = document
    *groups, name = key.split(".")
    for part in groups:
        group = group.setdefault(part, tomlkit.table())
    group[name] = _item(value)
    text = tomlkit.dumps(document)
    try:
        Config.model_validate(tomllib.loads(text))
        path.write_text(text, encoding="utf-8")
    except ValidationError as error:
        raise ConfigError(f"{path}: {complaint(Config, error)}") from error
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error


def _item(value: Mapping[str, object] | float) -> Any:
    """Value as it is written into a file: groups on one line."""
    if not isinstance(value, Mapping):
        return tomlkit.item(value)
    table = tomlkit.inline_table()
    table.update(value)
    return table
