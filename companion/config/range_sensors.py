"""Configuration of the range sensors: type and connection of each beam's sensor."""

from typing import Annotated, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field

from companion.core.messages import Beam

SharpCurve = Literal["gp2y0a710k0f", "paper"]
Profile = Literal["gp2y0a710k0f", "paper", "vl53l1x", "tfmini_s", "tf_luna"]
PROFILES: tuple[str, ...] = get_args(Profile)
"""Names of all sensor profiles."""


class Group(BaseModel):
    """A group of keys; unknown keys are rejected."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class AdcChannel(Group):
    """ADC input of a Sharp sensor."""

    address: int = Field(ge=0x48, le=0x4B)
    """I2C address of the ADS1115."""
    channel: int = Field(ge=0, le=3)


class _Mounted(Group):
    mount_offset_m: float | None = Field(None, ge=0, le=1)
    """Distance from the drone's centre along the beam, m; None: sensors.mount_offset_m."""
    bearing_deg: float | None = Field(None, ge=-180, le=180)
    """Bearing, clockwise from the nose seen from above; None: that of the beam's name."""


class SharpOnAds1115(_Mounted, AdcChannel):
    """A Sharp sensor at an input of an ADS1115."""

    kind: Literal["sharp_ads1115"] = "sharp_ads1115"
    curve: SharpCurve = "gp2y0a710k0f"


class SharpOnMcp3008(_Mounted):
    """A Sharp sensor at an input of an MCP3008."""

    kind: Literal["sharp_mcp3008"] = "sharp_mcp3008"
    device: str = Field("/dev/spidev0.0", pattern=r"^/dev/spidev\d+\.\d+$")
    """SPI bus and chip select."""
    channel: int = Field(ge=0, le=7)
    reference_v: float = Field(3.3, ge=3.2, le=5.5)
    """Voltage at the chip's VREF, above the sensor's output range, so that a short to a rail is
    detected."""
    curve: SharpCurve = "gp2y0a710k0f"


class Vl53l1xSensor(_Mounted):
    """A VL53L1X, alone or behind a TCA9548A: all of them start with the same address."""

    kind: Literal["vl53l1x"] = "vl53l1x"
    address: int = Field(0x29, ge=0x08, le=0x77)
    mux_address: int | None = Field(None, ge=0x70, le=0x77)
    mux_channel: int = Field(0, ge=0, le=7)


class TfminiSensor(_Mounted):
    """A TFmini-S or TF-Luna at a serial port."""

    kind: Literal["tfmini_s", "tf_luna"]
    port: str = Field(pattern=r"^/dev/\S+$")
    baud: int = Field(115200, ge=9600, le=921600)


class AutopilotRange(_Mounted):
    """A sensor of the autopilot, reported as DISTANCE_SENSOR with the beam's orientation."""

    kind: Literal["autopilot"] = "autopilot"
    min_m: float = Field(0.2, gt=0, le=5)
    max_m: float = Field(8.0, gt=0, le=50)
    sigma_m: float = Field(0.05, gt=0, le=1)
    """Sigma of a reading whose message contains no covariance, m."""


RangeSensor = Annotated[
    SharpOnAds1115 | SharpOnMcp3008 | Vl53l1xSensor | TfminiSensor | AutopilotRange,
    Field(discriminator="kind"),
]


class Calibration(Group):
    """Calibration of one unit by tape measure: it reads gain × distance + offset_m."""

    gain: float = Field(1.0, ge=0.5, le=2)
    offset_m: float = Field(0.0, ge=-0.5, le=0.5)


USUAL_BEAMS = (Beam.FRONT, Beam.LEFT, Beam.RIGHT, Beam.UP, Beam.DOWN)
"""Beams of the default wiring, in order of channels and ports."""
USUAL_MUX = 0x70
"""Default I2C address of the multiplexer."""


def usual_channels() -> dict[Beam, AdcChannel]:
    """Default wiring: five Sharp sensors on two ADS1115."""
    return {
        Beam.FRONT: AdcChannel(address=0x48, channel=0),
        Beam.LEFT: AdcChannel(address=0x48, channel=1),
        Beam.RIGHT: AdcChannel(address=0x48, channel=2),
        Beam.UP: AdcChannel(address=0x49, channel=0),
        Beam.DOWN: AdcChannel(address=0x49, channel=1),
    }


def usual_sensors(profile: Profile, channels: dict[Beam, AdcChannel]) -> dict[Beam, RangeSensor]:
    """Five sensors of one type in the default wiring; `channels` are those of Sharp sensors."""
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
