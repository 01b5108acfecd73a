"""Configuration of the range sensors: kind and wiring of each beam's sensor."""

from typing import Annotated, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field

from companion.core.messages import Beam

SharpCurve = Literal["gp2y0a710k0f", "paper"]
Profile = Literal["gp2y0a710k0f", "paper", "vl53l1x", "tfmini_s", "tf_luna"]
PROFILES: tuple[str, ...] = get_args(Profile)
"""Names of all sensor profiles."""


class Group(BaseModel):
    """One table of the TOML file. An unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class AdcChannel(Group):
    """Input of an ADS1115 to which a Sharp sensor is wired."""

    address: int = Field(ge=0x48, le=0x4B)
    """I2C address of the ADS1115, 0x48 to 0x4B."""
    channel: int = Field(ge=0, le=3)
    """Input of the ADS1115."""


class _Mounted(Group):
    mount_offset_m: float | None = Field(None, ge=0, le=1)
    """Distance from the drone's centre to the sensor, along its beam. Default:
    `sensors.mount_offset_m`."""
    bearing_deg: float | None = Field(None, ge=-180, le=180)
    """Bearing of a level beam, clockwise from ahead, within 20° of its nominal bearing. Default:
    the nominal bearing."""


class SharpOnAds1115(_Mounted, AdcChannel):
    """A Sharp sensor at an input of an ADS1115."""

    kind: Literal["sharp_ads1115"] = "sharp_ads1115"
    curve: SharpCurve = "gp2y0a710k0f"
    """Curve from voltage to distance: the datasheet's, or that of the paper's simulator."""


class SharpOnMcp3008(_Mounted):
    """A Sharp sensor at an input of an MCP3008."""

    kind: Literal["sharp_mcp3008"] = "sharp_mcp3008"
    device: str = Field("/dev/spidev0.0", pattern=r"^/dev/spidev\d+\.\d+$")
    """SPI device: bus and chip select."""
    channel: int = Field(ge=0, le=7)
    """Input of the MCP3008."""
    reference_v: float = Field(3.3, ge=3.2, le=5.5)
    """Voltage at the chip's VREF. It exceeds the sensor's highest output, so that a rail is
    detected."""
    curve: SharpCurve = "gp2y0a710k0f"
    """Curve from voltage to distance: the datasheet's, or that of the paper's simulator."""


class Vl53l1xSensor(_Mounted):
    """A VL53L1X, alone or behind a TCA9548A. All VL53L1X start with the same I2C address."""

    kind: Literal["vl53l1x"] = "vl53l1x"
    address: int = Field(0x29, ge=0x08, le=0x77)
    """I2C address of the sensor."""
    mux_address: int | None = Field(None, ge=0x70, le=0x77)
    """I2C address of the TCA9548A before the sensor. Default: no multiplexer."""
    mux_channel: int = Field(0, ge=0, le=7)
    """Branch of the TCA9548A."""


class TfminiSensor(_Mounted):
    """A TFmini-S or TF-Luna at a serial port."""

    kind: Literal["tfmini_s", "tf_luna"]
    port: str = Field(pattern=r"^/dev/\S+$")
    """Serial port, such as `/dev/ttyAMA2`."""
    baud: int = Field(115200, ge=9600, le=921600)
    """Baud rate of the port."""


class AutopilotRange(_Mounted):
    """A rangefinder of the autopilot, received as DISTANCE_SENSOR with the beam's orientation."""

    kind: Literal["autopilot"] = "autopilot"
    min_m: float = Field(0.2, gt=0, le=5)
    """Smallest distance that the sensor measures."""
    max_m: float = Field(8.0, gt=0, le=50)
    """Largest distance that the sensor measures."""
    sigma_m: float = Field(0.05, gt=0, le=1)
    """Standard deviation of a reading, if the message reports no covariance."""


RangeSensor = Annotated[
    SharpOnAds1115 | SharpOnMcp3008 | Vl53l1xSensor | TfminiSensor | AutopilotRange,
    Field(discriminator="kind"),
]


class Calibration(Group):
    """Calibration of one sensor against a tape measure: it reads gain × distance + offset_m."""

    gain: float = Field(1.0, ge=0.5, le=2)
    """Scale factor of the sensor's readings."""
    offset_m: float = Field(0.0, ge=-0.5, le=0.5)
    """Offset of the sensor's readings."""


USUAL_BEAMS = (Beam.FRONT, Beam.LEFT, Beam.RIGHT, Beam.UP, Beam.DOWN)
"""Beams of the default wiring, in order of channels and ports."""
USUAL_MUX = 0x70
"""Default I2C address of the multiplexer."""


def usual_channels() -> dict[Beam, AdcChannel]:
    """Default wiring of five Sharp sensors on two ADS1115."""
    return {
        Beam.FRONT: AdcChannel(address=0x48, channel=0),
        Beam.LEFT: AdcChannel(address=0x48, channel=1),
        Beam.RIGHT: AdcChannel(address=0x48, channel=2),
        Beam.UP: AdcChannel(address=0x49, channel=0),
        Beam.DOWN: AdcChannel(address=0x49, channel=1),
    }


def usual_sensors(profile: Profile, channels: dict[Beam, AdcChannel]) -> dict[Beam, RangeSensor]:
    """Five sensors of one kind, with default wiring; Sharp sensors are wired as in `channels`."""
    match profile:
        case "gp2y0a710k0f" | "paper":
            return {
                beam: SharpOnAds1115(address=c.address, channel=c.channel, curve=profile)
                for beam, c in channels.items()
            }
        case "vl53l1x":
            return {
                beam: Vl53l1xSensor(mux_address=USUAL_MUX, mux_channel=number)
                for number, beam in enumerate(USUAL_BEAMS)
            }
        case "tfmini_s" | "tf_luna":
            return {
                beam: TfminiSensor(kind=profile, port=f"/dev/ttyAMA{number}")
                for number, beam in enumerate(USUAL_BEAMS, start=1)
            }
